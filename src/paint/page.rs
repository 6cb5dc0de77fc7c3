//! The page as HTML: either a page that sends requests to the server, or one file that contains the matrix.

use askama::Template;
use serde_json::{Value, json};

use super::canvas::Canvas;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::io::raster;
use crate::report::colormap::signed_color;
use crate::report::palette::label_color;
use crate::report::web::{COLOR, FORMAT, Module, NUMPY, PICTURE, VALUES, VIEW, bundle, embedded_json};

pub use super::embedded::{EmbedOptions, Embedded, Kept, Precision};

/// The script modules of the page. Each module is listed after the modules that it imports.
const MODULES: [Module; 18] = [
    FORMAT,
    COLOR,
    VIEW,
    PICTURE,
    NUMPY,
    VALUES,
    ("brush.js", include_str!("web/brush.js")),
    ("history.js", include_str!("web/history.js")),
    ("exr.js", include_str!("web/exr.js")),
    ("files.js", include_str!("web/files.js")),
    ("served.js", include_str!("web/served.js")),
    ("embedded.js", include_str!("web/embedded.js")),
    ("conductor.js", include_str!("web/conductor.js")),
    ("display.js", include_str!("web/display.js")),
    ("easel.js", include_str!("web/easel.js")),
    ("pointing.js", include_str!("web/pointing.js")),
    ("questions.js", include_str!("web/questions.js")),
    ("page.js", include_str!("web/page.js")),
];

/// The script modules of the worker in a page without a server.
pub(super) const WORKER: [Module; 4] = [
    VALUES,
    ("matrix.js", include_str!("web/matrix.js")),
    ("solver.js", include_str!("web/solver.js")),
    ("worker.js", include_str!("web/worker.js")),
];

/// The page that a server sends for a canvas. Its scripts have the attribute `nonce`.
#[cfg(feature = "paint")]
pub(super) fn served(canvas: &mut Canvas<'_>, nonce: &str) -> Result<String> {
    let about =
        "Everything that is painted here stays on this machine and the server that printed this address.";
    page(&describe(canvas)?, about, Some(nonce), "")
}

#[derive(Template)]
#[template(path = "paint.html", config = "src/report/askama.toml")]
struct Page<'a> {
    title: &'a str,
    about: &'a str,
    /// The attribute that permits the page's own scripts and styles; empty if scripts are not restricted.
    nonce: String,
    style: &'static str,
    info: String,
    /// The elements with the matrix and the worker.
    data: &'a str,
    script: String,
}

/// The page as HTML. `info` describes the source for the scripts. `data` has the elements with the matrix.
pub(super) fn page(info: &Value, about: &str, nonce: Option<&str>, data: &str) -> Result<String> {
    let page = Page {
        title: info["name"].as_str().unwrap_or_default(),
        about,
        nonce: nonce.map(|nonce| format!(" nonce=\"{nonce}\"")).unwrap_or_default(),
        style: include_str!("web/paint.css"),
        info: embedded_json(info),
        data,
        script: bundle(&MODULES),
    };
    page.render().map_err(|error| Error::Numerical(format!("the painting page's template: {error}")))
}

/// The description of the source for the page's scripts.
pub(super) fn describe(canvas: &mut Canvas<'_>) -> Result<Value> {
    let channels = canvas.channels();
    let white = Image::from_planes(canvas.camera(), canvas.white()?)?;
    let size = |of: crate::image::Resolution| [of.width, of.height];
    const SIGNED: i32 = 128;
    let signed_colors: Vec<u8> =
        (-SIGNED..=SIGNED).flat_map(|step| signed_color(f64::from(step) / f64::from(SIGNED))).collect();
    let welcome = match (canvas.is_live(), canvas.layers().is_empty()) {
        (true, _) => "Live: each photo is taken by the rig",
        (false, true) => "Photos come from a model, or are traced anew",
        (false, false) => "The light transport matrix is in memory",
    };
    Ok(json!({
        "name": canvas.lab().name(),
        "unit": canvas.lab().unit(),
        "projector": size(canvas.projector()),
        "camera": size(canvas.camera()),
        "channels": channels,
        "lights": canvas.lights(),
        "isSigned": canvas.is_signed(),
        "isLinear": !canvas.is_live(),
        "isSquare": canvas.projector() == canvas.camera(),
        "isEmbedded": false,
        "white": 1.0 / f64::from(raster::exposure(&white)),
        "welcome": welcome,
        "signedColors": signed_colors,
        "labelColors": (0..=u8::MAX).flat_map(label_color).collect::<Vec<u8>>(),
    }))
}
