//! Segmentation, compensation and separation, and the figures of the paper that they make.

mod compensation;
mod paper_figures;
mod segmentation;
mod separation;
