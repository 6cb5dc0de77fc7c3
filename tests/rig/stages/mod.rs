//! The stages from counts to products, each compared with an explicit dense matrix.

mod algebra;
mod bit_planes;
mod colour;
mod dynamic_range;
mod monte_carlo;
mod quantization;
mod replay;
mod support;
mod switched_off;
mod virtual_bench;
