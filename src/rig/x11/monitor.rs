//! The monitors of an X server, and the checks that a monitor shows pixels unchanged.

use x11rb::connection::{Connection, RequestConnection};
use x11rb::errors::ReplyError;
use x11rb::protocol::randr::{ConnectionExt as _, Crtc, GetScreenResourcesCurrentReply};
use x11rb::protocol::xproto::{ConnectionExt as _, Window};
use x11rb::rust_connection::RustConnection;

use super::{MonitorInfo, X11Monitor, X11Spec, fault, lost};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::rig::did_you_mean;

/// The fraction of full scale by which a gamma ramp may deviate from a straight line: half of an 8-bit level.
const RAMP_TOLERANCE: f64 = 0.5 / 255.0;

/// Lists the monitors of a server in the server's order. `display` has the meaning of [`X11Spec::display`].
///
/// # Errors
/// [`Error::Rig`] when the server cannot be reached, or does not know its monitors.
pub fn monitors(display: Option<&str>) -> Result<Vec<MonitorInfo>> {
    let (connection, screen) = connect(display)?;
    let root = connection.setup().roots[screen].root;
    listed(&connection, root)
}

impl X11Spec {
    /// Finds the described monitor, and checks that it has the described properties and shows levels unchanged. An [`Error::Rig`] names the
    /// difference and the remedy.
    pub fn monitor(&self) -> Result<MonitorInfo> {
        let (connection, screen) = connect(self.display.as_deref())?;
        let root = connection.setup().roots[screen].root;
        let mut monitor = choose(listed(&connection, root)?, self)?;
        monitor.knows_ramp = check_passes(&connection, &monitor)?;
        Ok(monitor)
    }
}

const WAYLAND: &str = "the compositor of a Wayland session may scale and recolour windows, and its X server (XWayland) does not say \
                       when a frame is on screen";

/// Connects to a server, which must drive its monitors directly. XWayland is refused.
pub(crate) fn connect(display: Option<&str>) -> Result<(RustConnection, usize)> {
    let (connection, screen) = x11rb::connect(display).map_err(|why| {
        let name = display.map_or_else(|| std::env::var("DISPLAY").unwrap_or_default(), str::to_owned);
        no_server(&name, std::env::var_os("WAYLAND_DISPLAY").is_some(), &why.to_string())
    })?;
    let extension = connection.extension_information("XWAYLAND");
    if extension.map_err(|why| lost("list its extensions", &why))?.is_some() {
        return Err(fault(
            format!("this X server is XWayland, which cannot project: {WAYLAND}"),
            "log in to an X11 session, or start a separate Xorg for the projector: display = \":1\" in [projector]",
        ));
    }
    Ok((connection, screen))
}

/// The error for a server that cannot be reached. `name` is empty if no name was given.
fn no_server(name: &str, is_wayland: bool, why: &str) -> Error {
    let help = "start it, or give the server as display = \":0\" in [projector], or set DISPLAY";
    match (name.is_empty(), is_wayland) {
        (true, true) => fault(
            format!("there is no X server, but Wayland, which is not supported: {WAYLAND}"),
            "log in to an X11 session, or start a separate Xorg for the projector: display = \":1\" in [projector]",
        ),
        (true, false) => fault("there is no X server: DISPLAY is not set", help),
        (false, _) => fault(format!("the X server \"{name}\" cannot be reached: {why}"), help),
    }
}

pub(crate) fn listed(connection: &RustConnection, root: Window) -> Result<Vec<MonitorInfo>> {
    ask_monitors(connection, root).map_err(|why| lost("list its monitors", &why))
}

fn ask_monitors(
    connection: &RustConnection,
    root: Window,
) -> std::result::Result<Vec<MonitorInfo>, ReplyError> {
    connection.randr_query_version(1, 5)?.reply()?;
    let found = connection.randr_get_monitors(root, true)?.reply()?;
    let resources = connection.randr_get_screen_resources_current(root)?.reply()?;
    let mut monitors = Vec::new();
    for monitor in found.monitors {
        let name = connection.get_atom_name(monitor.name)?.reply()?.name;
        let mut crtcs = Vec::new();
        for output in monitor.outputs {
            let output = connection.randr_get_output_info(output, resources.config_timestamp)?.reply()?;
            if output.crtc != x11rb::NONE {
                crtcs.push(output.crtc);
            }
        }
        monitors.push(MonitorInfo {
            name: String::from_utf8_lossy(&name).into_owned(),
            resolution: Resolution::new(monitor.width.into(), monitor.height.into()),
            place: [monitor.x, monitor.y],
            is_primary: monitor.primary,
            frame_time: frame_time(connection, &crtcs, &resources)?,
            knows_ramp: false,
            crtcs,
        });
    }
    Ok(monitors)
}

/// Seconds from one refresh to the next for the first of these display controllers.
fn frame_time(
    connection: &RustConnection,
    crtcs: &[Crtc],
    resources: &GetScreenResourcesCurrentReply,
) -> std::result::Result<Option<f64>, ReplyError> {
    let Some(&crtc) = crtcs.first() else { return Ok(None) };
    let crtc = connection.randr_get_crtc_info(crtc, resources.config_timestamp)?.reply()?;
    let mode = resources.modes.iter().find(|mode| mode.id == crtc.mode);
    // A server without a real display, such as Xvfb, reports 0.
    let known = mode.filter(|mode| mode.dot_clock > 0 && mode.htotal > 0 && mode.vtotal > 0);
    Ok(known.map(|mode| f64::from(mode.htotal) * f64::from(mode.vtotal) / f64::from(mode.dot_clock)))
}

pub(crate) fn choose(monitors: Vec<MonitorInfo>, spec: &X11Spec) -> Result<MonitorInfo> {
    let names: Vec<String> = monitors.iter().map(|monitor| monitor.name.clone()).collect();
    let listed = names.iter().enumerate().map(|(at, name)| format!("{at} ({name})"));
    let help = format!("monitors of this server: {}", listed.collect::<Vec<_>>().join(", "));
    let at = match &spec.monitor {
        X11Monitor::Number(number) => Some(*number).filter(|number| *number < names.len()),
        X11Monitor::Name(name) => names.iter().position(|known| known == name),
    };
    let Some(monitor) = at.and_then(|at| monitors.into_iter().nth(at)) else {
        let meant = match &spec.monitor {
            X11Monitor::Name(name) => did_you_mean(name, &names, "\""),
            X11Monitor::Number(_) => String::new(),
        };
        return Err(fault(format!("there is no monitor \"{}\"{meant}", spec.monitor), help));
    };
    let (name, found) = (&monitor.name, monitor.resolution);
    if let Some([width, height]) = spec.monitor_size
        && found != Resolution::new(width, height)
    {
        return Err(fault(
            format!("monitor {name} has {found} pixels, but the rig file says {width}x{height}"),
            format!(
                "set its own pixels (xrandr --output {name} --mode {width}x{height}), or correct monitor_size"
            ),
        ));
    }
    let shown = spec.shown();
    if shown.width > found.width || shown.height > found.height {
        return Err(fault(
            format!("monitor {name} has {found} pixels, fewer than the {shown} that the patterns take"),
            "give a smaller size or magnify in [projector], or another monitor",
        ));
    }
    if let Some(frame_time) = monitor.frame_time
        && (frame_time / spec.frame_time - 1.0).abs() > 0.02
    {
        return Err(fault(
            format!(
                "monitor {name} refreshes every {frame_time:.5} s, but the rig file says {} s",
                spec.frame_time
            ),
            format!("write frame_time = {frame_time:.5} in [projector]"),
        ));
    }
    Ok(monitor)
}

/// Checks that levels reach this monitor unchanged: its gamma ramp is a straight line, and it has no transform. Returns whether the server
/// reports a ramp for each of the monitor's display controllers.
pub(crate) fn check_passes(connection: &RustConnection, monitor: &MonitorInfo) -> Result<bool> {
    let reports = |crtc: Crtc| -> std::result::Result<_, ReplyError> {
        let gamma = connection.randr_get_crtc_gamma(crtc)?.reply()?;
        Ok((gamma, connection.randr_get_crtc_transform(crtc)?.reply()?.current_transform))
    };
    let name = &monitor.name;
    let mut knows_ramp = !monitor.crtcs.is_empty();
    for &crtc in &monitor.crtcs {
        let (gamma, transform) =
            reports(crtc).map_err(|why| lost("report a monitor's gamma ramp and transform", &why))?;
        let ramps: [&[u16]; 3] = [&gamma.red, &gamma.green, &gamma.blue];
        let is_ramp = is_ramp(ramps);
        knows_ramp &= is_ramp;
        if is_ramp && ramps.into_iter().any(|ramp| !is_line(ramp)) {
            return Err(fault(
                format!(
                    "monitor {name} has a gamma ramp: a colour profile or a night light changes what is shown"
                ),
                format!("switch it off: xrandr --output {name} --gamma 1:1:1"),
            ));
        }
        if !is_identity(&transform) {
            return Err(fault(
                format!("monitor {name} is scaled or rotated by the server"),
                format!("switch it off: xrandr --output {name} --scale 1x1 --rotate normal"),
            ));
        }
    }
    Ok(knows_ramp)
}

/// Whether these gamma ramps of red, green and blue were really set. They count as set if each ramp only rises or only falls, and at least
/// one spans a part of the range. A server without a real display has no ramps or only zeros, and Xvfb, after its first client has left,
/// returns uninitialized memory.
fn is_ramp(ramps: [&[u16]; 3]) -> bool {
    let tolerance = (65535.0 * RAMP_TOLERANCE) as u16;
    let goes_one_way = |ramp: &[u16]| {
        let steps = || ramp.windows(2);
        steps().all(|step| step[1] >= step[0].saturating_sub(tolerance))
            || steps().all(|step| step[1] <= step[0].saturating_add(tolerance))
    };
    let spans = |ramp: &[u16]| {
        let ends = ramp.first().zip(ramp.last());
        let steps = ramp.windows(2).filter(|step| step[0] != step[1]).count();
        ends.is_some_and(|(first, last)| first.abs_diff(*last) > 16 * tolerance) && steps >= ramp.len() / 8
    };
    ramps.iter().all(|ramp| goes_one_way(ramp)) && ramps.iter().any(|ramp| spans(ramp))
}

fn is_line(ramp: &[u16]) -> bool {
    let last = (ramp.len() - 1) as f64;
    ramp.iter()
        .enumerate()
        .all(|(at, &value)| (f64::from(value) / 65535.0 - at as f64 / last).abs() <= RAMP_TOLERANCE)
}

/// Whether a transform, in 16.16 fixed point, is the identity.
fn is_identity(transform: &x11rb::protocol::render::Transform) -> bool {
    const ONE: i32 = 1 << 16;
    let rows = transform;
    [rows.matrix11, rows.matrix22, rows.matrix33] == [ONE; 3]
        && [rows.matrix12, rows.matrix13, rows.matrix21, rows.matrix23, rows.matrix31, rows.matrix32]
            == [0; 6]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn monitor(name: &str, width: usize, height: usize) -> MonitorInfo {
        MonitorInfo {
            name: name.into(),
            resolution: Resolution::new(width, height),
            place: [0, 0],
            is_primary: false,
            frame_time: None,
            knows_ramp: false,
            crtcs: Vec::new(),
        }
    }

    #[test]
    fn a_monitor_is_chosen_by_name_or_number_and_must_fit() {
        let both = || vec![monitor("HDMI-1", 640, 480), monitor("DP-2", 1920, 1080)];
        let spec = X11Spec::new(320, 240);
        let of = |spec: &X11Spec| choose(both(), spec).map(|monitor| monitor.name);
        let refused = |spec: &X11Spec| of(spec).expect_err("it is refused").to_string();
        assert_eq!(of(&spec).expect("the first"), "HDMI-1");
        let named = |name: &str| X11Spec { monitor: X11Monitor::Name(name.into()), ..spec.clone() };
        assert_eq!(of(&named("DP-2")).expect("it is there"), "DP-2");
        assert!(refused(&named("HDMI1")).contains("did you mean \"HDMI-1\"?"));
        assert!(refused(&named("HDMI1")).contains("0 (HDMI-1), 1 (DP-2)"));
        let third = X11Spec { monitor: X11Monitor::Number(2), ..spec.clone() };
        assert!(refused(&third).contains("no monitor \"2\""));
        let large = X11Spec { magnify: 3, ..spec.clone() };
        assert!(refused(&large).contains("640x480 pixels, fewer than the 960x720"));
        let native = X11Spec { monitor_size: Some([1920, 1080]), ..spec.clone() };
        assert!(refused(&native).contains("but the rig file says 1920x1080"));
        let mut slow = monitor("A", 640, 480);
        slow.frame_time = Some(1.0 / 50.0);
        assert!(
            choose(vec![slow], &spec).expect_err("60 Hz is said").to_string().contains("frame_time = 0.02")
        );
    }

    #[test]
    fn without_a_server_the_error_says_what_there_is_instead() {
        let wayland = no_server("", true, "").to_string();
        assert!(
            wayland.contains("but Wayland, which is not supported") && wayland.contains("does not say when")
        );
        assert!(wayland.contains("log in to an X11 session"), "{wayland}");
        assert!(no_server("", false, "").to_string().contains("DISPLAY is not set"));
        assert!(no_server(":7", true, "refused").to_string().contains("\":7\" cannot be reached: refused"));
    }

    #[test]
    fn only_a_straight_ramp_passes() {
        let ramp = |gamma: f64, light: f64| -> Vec<u16> {
            (0..256)
                .map(|at| (65535.0 * light * (f64::from(at) / 255.0).powf(gamma)).round() as u16)
                .collect()
        };
        assert!(is_line(&ramp(1.0, 1.0)));
        assert!(!is_line(&ramp(1.05, 1.0)));
        // A night light has ramps like `dimmed` and `off`, because it may switch blue off. `inverted` inverts colours.
        let [dimmed, off, bent] = [ramp(1.0, 0.9), ramp(1.0, 0.0), ramp(2.2, 1.0)];
        let inverted: Vec<u16> = ramp(1.0, 1.0).into_iter().rev().collect();
        assert!(!is_line(&dimmed) && !is_line(&off) && !is_line(&inverted));
        for blue in [&dimmed, &off, &bent, &inverted] {
            assert!(is_ramp([&ramp(1.0, 1.0), &ramp(1.0, 1.0), blue]));
        }
        assert!(!is_ramp([&off, &off, &off]) && !is_ramp([&[], &[], &[]]));
    }

    /// The ramps are read from uninitialized memory, which holds 64-bit values such as pointers, small numbers and zeros.
    #[test]
    fn memory_that_nobody_has_written_is_no_ramp() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_pcg::Pcg64::seed_from_u64(1);
        for _ in 0..2000 {
            let pointers = random.random_range(0..30);
            let mut words = vec![0_u64; 192];
            for _ in 0..pointers {
                let at = random.random_range(0..192);
                words[at] = match random.random_range(0..3) {
                    0 => random.random_range(0..1000),
                    1 => 0x7f95_0000_0000 + random.random_range(0..1_u64 << 32),
                    _ => random.random(),
                };
            }
            let memory: Vec<u16> =
                words.iter().flat_map(|word| [0, 16, 32, 48].map(|shift| (word >> shift) as u16)).collect();
            let [red, green, blue] = [0, 256, 512].map(|from| &memory[from..from + 256]);
            assert!(!is_ramp([red, green, blue]), "{memory:?}");
        }
    }
}
