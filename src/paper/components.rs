//! Connected components of a group.

use crate::image::Resolution;

/// The pixels of each connected component (neighbours share an edge) of the pixels with `label`, largest component first.
pub(super) fn components(labels: &[u8], label: u8, resolution: Resolution) -> Vec<Vec<usize>> {
    let Resolution { width, height } = resolution;
    let mut seen = vec![false; labels.len()];
    let mut parts = Vec::new();
    for start in 0..labels.len() {
        if seen[start] || labels[start] != label {
            continue;
        }
        seen[start] = true;
        let (mut part, mut next) = (Vec::new(), vec![start]);
        while let Some(pixel) = next.pop() {
            part.push(pixel);
            let (x, y) = (pixel % width, pixel / width);
            let neighbours = [
                (x > 0).then(|| pixel - 1),
                (x + 1 < width).then_some(pixel + 1),
                (y > 0).then(|| pixel - width),
                (y + 1 < height).then_some(pixel + width),
            ];
            for neighbour in neighbours.into_iter().flatten() {
                if !seen[neighbour] && labels[neighbour] == label {
                    seen[neighbour] = true;
                    next.push(neighbour);
                }
            }
        }
        parts.push(part);
    }
    parts.sort_by_key(|part| std::cmp::Reverse(part.len()));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_touch_by_edges_and_the_largest_comes_first() {
        #[rustfmt::skip]
        let labels = [
            1, 0, 1,
            0, 1, 1,
        ];
        let parts = components(&labels, 1, Resolution::new(3, 2));
        assert_eq!(parts.iter().map(Vec::len).collect::<Vec<_>>(), [3, 1]);
        assert_eq!(parts[1], [0]);
        assert!(components(&labels, 7, Resolution::new(3, 2)).is_empty());
    }
}
