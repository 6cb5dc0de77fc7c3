//! Completions of shells and manual pages, which are made from the command line.

use std::process::Command;

use crate::program::{command_without_graphics, folder, inside, krylux, text};

/// The verbs that the program's help lists.
fn verbs() -> Vec<String> {
    let help = text(&krylux(&["--help"]).stdout);
    let listed = help.lines().skip_while(|line| !line.starts_with("Commands:")).skip(1);
    let listed = listed.take_while(|line| !line.is_empty() && line.starts_with("  "));
    // The lines that go on with a description are indented further.
    let names =
        listed.filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

#[test]
fn every_shell_completes_every_verb() {
    let verbs = verbs();
    assert!(verbs.len() > 15 && verbs.contains(&"segment".into()), "{verbs:?}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output =
            command_without_graphics(&["completions", shell]).output().expect("the program is built");
        assert_eq!(output.status.code(), Some(0), "{shell}: {}", text(&output.stderr));
        let script = text(&output.stdout);
        for verb in &verbs {
            assert!(script.contains(verb.as_str()), "{shell} does not complete {verb}");
        }
        assert!(script.contains("min-rand-index"), "{shell} completes options");
        assert!(!script.contains("describe-camera"), "{shell}: hidden verbs are krylux's own");
    }
}

#[test]
fn bash_completes_a_verb_and_an_option() {
    let folder = folder();
    let script = inside(&folder, "krylux.bash");
    let wrote = krylux(&["completions", "bash", "-o", &script]);
    assert_eq!(wrote.status.code(), Some(0), "{}", text(&wrote.stderr));
    let completed = |words: &str, last: usize| {
        let word = words.split(' ').next_back().unwrap_or_default();
        let ask = format!(
            "source '{script}'; COMP_WORDS=({words}); COMP_CWORD={last}; _krylux krylux '{word}' ''; echo \"${{COMPREPLY[*]}}\""
        );
        text(&Command::new("bash").args(["-c", &ask]).output().expect("there is a bash").stdout)
    };
    assert_eq!(completed("krylux seg", 1).trim(), "segment");
    assert!(completed("krylux compare --min-p", 2).contains("--min-psnr"));
}

#[test]
fn every_verb_has_a_manual_page() {
    let folder = folder();
    let pages = inside(&folder, "man1");
    let output = krylux(&["man", "-o", &pages]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let page = |name: &str| std::fs::read_to_string(format!("{pages}/{name}.1")).unwrap_or_default();
    for verb in verbs() {
        let page = page(&format!("krylux-{verb}"));
        assert!(page.starts_with(".ie") || page.contains(".TH"), "{verb} has a page: {page}");
        assert!(page.contains("\\-\\-quiet"), "{verb}: options of all verbs are there");
    }
    assert!(page("krylux").contains("light transport laboratory"));
    assert!(page("krylux-projector").is_empty(), "hidden verbs have none");
    let printed = krylux(&["man"]);
    assert_eq!(text(&printed.stdout), page("krylux"));
}

#[test]
fn with_json_the_summary_holds_the_script() {
    let output = krylux(&["completions", "fish", "--json"]);
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert!(summary["script"].as_str().is_some_and(|script| script.contains("complete -c krylux")));
}
