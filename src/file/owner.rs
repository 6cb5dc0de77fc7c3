//! Who may change a file.

use std::fs;

/// The reason why users other than this process' user and root may change a file or folder, such as `can be written by everybody`; `None` if they may not.
pub(crate) fn stranger(about: &fs::Metadata) -> Option<String> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        stranger_of(rustix::process::geteuid().as_raw(), (about.uid(), about.mode()))
    }
    // Elsewhere a user's own folders are written by nobody else.
    #[cfg(not(unix))]
    {
        let _ = about;
        None
    }
}

/// As [`stranger`], for a user, and an owner with a mode. The sticky bit of a folder is no help, since it lets others add files.
#[cfg(unix)]
fn stranger_of(user: u32, (owner, mode): (u32, u32)) -> Option<String> {
    if owner != user && owner != 0 {
        return Some(format!("belongs to user {owner}, and krylux runs as user {user}"));
    }
    let others = if mode & 0o002 != 0 { "everybody" } else { "its group" };
    (mode & 0o022 != 0).then(|| format!("can be written by {others} (`chmod go-w` ends that)"))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn only_the_user_and_root_are_no_strangers() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_pcg::Pcg64::seed_from_u64(1);
        let mut counts = [0; 2];
        for _ in 0..20_000 {
            let users = [0, 1000, 1001, 65534];
            let [user, owner] = [0; 2].map(|_| users[random.random_range(0..users.len())]);
            let mode = random.random_range(0..0o10000);
            // Who can change it: its owner (who can change its mode), and its group and all others, by their bits.
            let may_write = |who: u32| who == owner || mode & 0o020 != 0 || mode & 0o002 != 0;
            let is_safe = users.into_iter().filter(|who| ![0, user].contains(who)).all(|who| !may_write(who));
            assert_eq!(stranger_of(user, (owner, mode)).is_none(), is_safe, "{user} {owner} {mode:o}");
            counts[usize::from(is_safe)] += 1;
        }
        assert!(counts[0] > 1000 && counts[1] > 1000, "{counts:?}");
        let sudo = stranger_of(0, (1000, 0o644)).expect("under sudo the file is not root's");
        assert!(sudo.contains("user 1000") && sudo.contains("runs as user 0"), "{sudo}");
    }
}
