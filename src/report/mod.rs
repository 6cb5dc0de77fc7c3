//! Presentation of results: pictures, plots and report pages for each command.
//!
//! | content | module |
//! |---|---|
//! | `report.html` | [`html`], with plots from [`plot`] and [`scatter`] |
//! | colours of values and of groups | [`colormap`], [`palette`] |
//! | contact sheet of all photos of a run | [`contact_sheet`] |
//! | parts of every page: sections, figures, files | [`run`] |
//! | pictures as files for people | `print` |
//! | live images in an external viewer | [`viewer`] |
//! | a page over many runs | [`index`] |
//! | scripts of pages | [`web`] |
//!
//! Files are written through [`crate::io`].

mod axis;
pub mod colormap;
pub mod contact_sheet;
pub mod content;
pub(crate) mod figure;
pub mod html;
pub mod index;
pub mod palette;
pub mod plot;
pub(crate) mod print;
pub(crate) mod residuals;
pub mod run;
pub mod scatter;
pub(crate) mod spectrum;
mod svg;
pub mod text;
pub mod viewer;
pub mod web;

pub(crate) use run::stages;
