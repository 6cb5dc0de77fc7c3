//! An X server without a screen (Xvfb), and access to its pixels and windows.
#![allow(dead_code, reason = "each test binary uses its own part of this")]

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use krylux::image::Resolution;
use krylux::rig::Frame;
use x11rb::connection::Connection;
use x11rb::image::Image;
use x11rb::protocol::randr::{ConnectionExt as _, MonitorInfo};
use x11rb::protocol::xproto::{ConnectionExt as _, Window};
use x11rb::rust_connection::RustConnection;

/// A running Xvfb, which ends with the test.
pub struct XServer {
    process: Child,
    pub display: String,
    connection: RustConnection,
    root: Window,
}

impl XServer {
    /// A server with a screen of this size and 24 bits per pixel.
    pub fn start(width: u16, height: u16) -> Self {
        Self::of_depth(width, height, 24)
    }

    pub fn of_depth(width: u16, height: u16, depth: u8) -> Self {
        Self::with(&["-screen", "0", &format!("{width}x{height}x{depth}")])
    }

    /// A server on this display with 24 bits per pixel. The display may have belonged to an earlier server.
    pub fn at(display: &str, width: u16, height: u16) -> Self {
        Self::with(&[display, "-screen", "0", &format!("{width}x{height}x24")])
    }

    /// A server with these arguments, which keeps its state when a client leaves.
    pub fn with(arguments: &[&str]) -> Self {
        let (process, display) = Self::process(&[&["-noreset"], arguments].concat());
        let (connection, screen) = x11rb::connect(Some(&display)).expect("it is there");
        let root = connection.setup().roots[screen].root;
        Self { process, display, connection, root }
    }

    /// Sets the ramps of red, green and blue.
    pub fn set_gamma(&self, [red, green, blue]: [&[u16]; 3]) {
        let resources = self.connection.randr_get_screen_resources_current(self.root).expect("sent");
        let crtc = resources.reply().expect("answered").crtcs[0];
        self.connection.randr_set_crtc_gamma(crtc, red, green, blue).expect("sent").check().expect("it fits");
    }

    /// The process of a server with these arguments, and its display.
    pub fn process(arguments: &[&str]) -> (Child, String) {
        let mut process = Command::new("Xvfb")
            // The server chooses a free display number, and prints it.
            .args(["-displayfd", "1", "-nolisten", "tcp"])
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("these tests need the X server without a screen: apt-get install -y xvfb");
        let mut number = String::new();
        let said = process.stdout.take().expect("it is piped");
        BufReader::new(said).read_line(&mut number).expect("it says its number");
        (process, format!(":{}", number.trim()))
    }

    /// Defines a part of the screen as a monitor.
    pub fn add_monitor(&self, name: &str, [x, y, width, height]: [i16; 4]) {
        let name = self
            .connection
            .intern_atom(false, name.as_bytes())
            .expect("sent")
            .reply()
            .expect("answered")
            .atom;
        let monitor = MonitorInfo {
            name,
            primary: false,
            automatic: false,
            x,
            y,
            width: width as u16,
            height: height as u16,
            width_in_millimeters: 100,
            height_in_millimeters: 100,
            outputs: Vec::new(),
        };
        self.connection.randr_set_monitor(self.root, monitor).expect("sent").check().expect("it fits");
    }

    /// Switches the monitor off and on, as a loose cable does.
    pub fn interrupt(&self) {
        let resources = self
            .connection
            .randr_get_screen_resources_current(self.root)
            .expect("sent")
            .reply()
            .expect("answered");
        let (crtc, time) = (resources.crtcs[0], resources.config_timestamp);
        let info = self.connection.randr_get_crtc_info(crtc, time).expect("sent").reply().expect("answered");
        for (mode, outputs) in [(x11rb::NONE, &[][..]), (info.mode, &info.outputs[..])] {
            let (now, rotation) = (x11rb::CURRENT_TIME, info.rotation);
            let set = self
                .connection
                .randr_set_crtc_config(crtc, now, time, info.x, info.y, mode, rotation, outputs)
                .expect("sent");
            set.reply().expect("answered");
        }
    }

    /// Red, green and blue of the pixels in a rectangle (left, top, width, height), row by row.
    pub fn pixels(&self, [x, y, width, height]: [i16; 4]) -> Vec<[u8; 3]> {
        let (image, _) =
            Image::get(&self.connection, self.root, x, y, width as u16, height as u16).expect("inside");
        let pixel = |at: usize| {
            let value = image.get_pixel((at % width as usize) as u16, (at / width as usize) as u16);
            [16, 8, 0].map(|shift| (value >> shift) as u8)
        };
        (0..width as usize * height as usize).map(pixel).collect()
    }

    /// A function that reads a gray pattern from the screen; each pattern pixel is a square with `magnify` screen pixels on a side. It
    /// returns `None` while there is no server, and connects to the next server on this display.
    pub fn view(
        &self,
        [x, y]: [i16; 2],
        magnify: usize,
        size: Resolution,
    ) -> impl FnMut() -> Option<Frame> + Send + use<> {
        let display = self.display.clone();
        let connect = move || {
            let (connection, screen) = x11rb::connect(Some(&display)).ok()?;
            let root = connection.setup().roots[screen].root;
            Some((connection, root))
        };
        let [width, height] = [size.width, size.height].map(|side| (magnify * side) as u16);
        let look = move |(connection, root): &(RustConnection, Window)| {
            Image::get(connection, *root, x, y, width, height).ok().map(|(image, _)| image)
        };
        let mut connected = connect();
        move || {
            let image = connected.as_ref().and_then(look).or_else(|| {
                // That server has ended.
                connected = connect();
                connected.as_ref().and_then(look)
            })?;
            let middle = |at: usize| (at * magnify + magnify / 2) as u16;
            let green = |at: usize| image.get_pixel(middle(at % size.width), middle(at / size.width)) >> 8;
            let levels = (0..size.pixels()).map(|at| u16::from(green(at) as u8)).collect();
            Some(Frame::new(size, 1, levels).expect("a level for each pixel"))
        }
    }

    /// The windows on the screen.
    pub fn windows(&self) -> Vec<Window> {
        self.connection.query_tree(self.root).expect("sent").reply().expect("answered").children
    }

    pub fn close(&self, window: Window) {
        self.connection.destroy_window(window).expect("sent").check().expect("it is there");
    }

    /// Puts a window above all others.
    pub fn cover(&self, place: [i16; 4]) -> Window {
        use x11rb::protocol::xproto::{CreateWindowAux, WindowClass};
        let [x, y, width, height] = place;
        let window = self.connection.generate_id().expect("there is one");
        let look = CreateWindowAux::new().override_redirect(1).background_pixel(0xff_8000);
        let class = WindowClass::INPUT_OUTPUT;
        self.connection
            .create_window(24, window, self.root, x, y, width as u16, height as u16, 0, class, 0, &look)
            .expect("sent");
        self.connection.map_window(window).expect("sent").check().expect("it is new");
        window
    }

    /// Draws a rectangle on a window that belongs to another program.
    pub fn scribble(&self, window: Window) {
        use x11rb::protocol::xproto::{CreateGCAux, Rectangle};
        let gc = self.connection.generate_id().expect("there is one");
        self.connection.create_gc(gc, window, &CreateGCAux::new().foreground(0x12_3456)).expect("sent");
        let place = Rectangle { x: 0, y: 0, width: 2000, height: 2000 };
        self.connection
            .poly_fill_rectangle(window, gc, &[place])
            .expect("sent")
            .check()
            .expect("it is there");
    }

    /// Kills the server, as a crash does.
    pub fn kill(&mut self) {
        self.process.kill().expect("it lives");
        self.process.wait().expect("it ends");
    }
}

impl Drop for XServer {
    fn drop(&mut self) {
        // The server may have been killed already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
