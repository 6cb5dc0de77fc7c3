//! Convex polygons on a raster: which texels they touch, which they cover, and how near they are there.

use glam::{DVec2, DVec3};

use super::MARGIN;

/// A polygon's corner on the raster.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub(super) at: DVec2,
    /// 1 over its depth: linear over the image of a plane.
    pub(super) inverse: f64,
}

/// The part of a triangle at a depth of `near` or more.
pub(super) fn clip(corners: &[DVec3; 3], near: f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(4);
    for (index, &from) in corners.iter().enumerate() {
        let to = corners[(index + 1) % 3];
        let inside = |point: DVec3| point.z <= -near;
        if inside(from) {
            kept.push(from);
        }
        if inside(from) != inside(to) {
            kept.push(from.lerp(to, (-near - from.z) / (to.z - from.z)));
        }
    }
    kept
}

/// From where to where a convex polygon reaches in x within `low ≤ y ≤ high`.
pub(super) fn extent_in_band(polygon: &[Corner], low: f64, high: f64) -> Option<(f64, f64)> {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut reach = |x: f64| {
        left = left.min(x);
        right = right.max(x);
    };
    for (index, corner) in polygon.iter().enumerate() {
        let (from, to) = (corner.at, polygon[(index + 1) % polygon.len()].at);
        if (low..=high).contains(&from.y) {
            reach(from.x);
        }
        for level in [low, high] {
            if (from.y < level) != (to.y < level) {
                reach(from.x + (to.x - from.x) * (level - from.y) / (to.y - from.y));
            }
        }
    }
    (left <= right).then_some((left, right))
}

/// Whether a texel, with its margin, lies inside a convex polygon.
pub(super) fn covers(polygon: &[Corner], column: usize, row: usize) -> bool {
    let [left, top] = [column, row].map(|index| index as f64 - MARGIN);
    let [right, bottom] = [column, row].map(|index| index as f64 + 1.0 + MARGIN);
    let (mut all_left, mut all_right) = (true, true);
    for (index, corner) in polygon.iter().enumerate() {
        let edge = polygon[(index + 1) % polygon.len()].at - corner.at;
        for (x, y) in [(left, top), (right, top), (left, bottom), (right, bottom)] {
            // NaN is on neither side: the texel is not covered.
            let side = edge.perp_dot(DVec2::new(x, y) - corner.at);
            all_left &= side < 0.0;
            all_right &= side > 0.0;
        }
    }
    all_left || all_right
}

/// 1 over the depth of a plane, over the raster.
pub(super) struct InverseDepth {
    at: DVec2,
    value: f64,
    gradient: DVec2,
}

impl InverseDepth {
    /// Through the corners of a polygon that is not seen edge on; edge on it covers nothing, and is nowhere nearer than its corners.
    pub(super) fn through(polygon: &[Corner]) -> Option<Self> {
        let first = polygon.first()?;
        let mut best = Self { at: first.at, value: first.inverse, gradient: DVec2::ZERO };
        let mut largest = 0.0;
        for pair in polygon[1..].windows(2) {
            let [a, b] = [pair[0].at - first.at, pair[1].at - first.at];
            let area = a.perp_dot(b);
            if area.abs() > largest {
                largest = area.abs();
                let [da, db] = [pair[0].inverse - first.inverse, pair[1].inverse - first.inverse];
                best.gradient = DVec2::new(da * b.y - db * a.y, db * a.x - da * b.x) / area;
            }
        }
        if largest < 1e-9 || !best.gradient.is_finite() {
            // Nearly edge on: its gradient means nothing. Let it count as near as its nearest corner everywhere.
            best.gradient = DVec2::splat(f64::INFINITY);
        }
        Some(best)
    }

    /// The least and the greatest over a texel with its margin.
    pub(super) fn over(&self, column: usize, row: usize) -> (f64, f64) {
        if !self.gradient.is_finite() {
            return (0.0, f64::INFINITY);
        }
        let centre = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
        let middle = self.value + self.gradient.dot(centre - self.at);
        let reach = (self.gradient.x.abs() + self.gradient.y.abs()) * (0.5 + MARGIN);
        (middle - reach, middle + reach)
    }
}
