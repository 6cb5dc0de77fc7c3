//! Light as it is traced, against closed forms and against another renderer.

mod analytic;
mod furnace;
mod glass;
mod lenses;
mod peers;
mod reference_photos;
mod reference_spectrum;
mod scales;
mod specular;
