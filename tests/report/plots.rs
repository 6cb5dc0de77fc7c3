//! Plots, and their data for the page's scripts.

use krylux::report::plot::{LinePlot, Series, StemPlot};
use krylux::report::scatter::ScatterPlot;

/// The value of an attribute of an element.
fn attribute<'a>(element: &'a str, name: &str) -> &'a str {
    let start =
        element.find(&format!(" {name}=\"")).map(|at| at + name.len() + 3).expect("the attribute is there");
    element[start..].split('"').next().expect("it ends")
}

/// Every text of a drawing that stands upright: left, right, baseline, and the text. Letters are 7.7 units wide.
fn texts(svg: &str) -> Vec<(f64, f64, f64, String)> {
    let parts = svg.split("<text ").skip(1).filter(|part| !part.starts_with("transform"));
    let text = |part: &str| {
        let part = format!(" {part}");
        let words = part.split('>').nth(1)?.split('<').next()?.to_owned();
        let [x, y] = ["x", "y"].map(|name| attribute(&part, name).parse::<f64>().expect("a number"));
        let width = 7.7 * words.chars().count() as f64;
        let left = match part.contains("text-anchor") {
            false => x,
            true if attribute(&part, "text-anchor") == "middle" => x - width / 2.0,
            true => x - width,
        };
        Some((left, left + width, y, words))
    };
    parts.filter_map(text).collect()
}

fn assert_apart(svg: &str) {
    let texts = texts(svg);
    assert!(texts.len() > 6, "{svg}");
    for (index, a) in texts.iter().enumerate() {
        for b in &texts[index + 1..] {
            let is_apart = a.1 <= b.0 || b.1 <= a.0 || (a.2 - b.2).abs() > 10.0;
            assert!(is_apart, "{a:?} and {b:?} overprint");
        }
    }
}

#[test]
fn labels_do_not_overprint() {
    // Numbers of seven letters, eight of which have no room side by side; and names of points that are all but one.
    for scale in [1e-3, 1.0, 1e4, 3e8] {
        let at = |index: usize| (scale * (index as f64 * 0.7 - 3.1), scale * ((index * 7 % 11) as f64 - 5.0));
        let plot = ScatterPlot {
            points: (0..40).map(|index| (at(index % 10), [10, 20, 30])).collect(),
            marked: ["A", "B", "C", "D"].iter().map(|name| (at(4), (*name).to_owned())).collect(),
            ..ScatterPlot::default()
        };
        let svg = plot.render();
        assert_apart(&svg);
        assert!(["A", "B", "C", "D"].iter().all(|name| svg.contains(&format!(">{name}</text>"))));
    }
}

#[test]
fn curves_tell_their_values_where_they_are_drawn() {
    let points = vec![(1.0, 0.5), (2.0, 0.25), (3.0, f64::NAN), (4.0, 0.125)];
    let plot = LinePlot {
        x_label: "photos".into(),
        y_label: "residual \"r\"".into(),
        logarithmic: true,
        series: vec![Series { name: "minres & <co>".into(), points }],
        marks: Vec::new(),
    };
    let svg = plot.render();
    assert_eq!((attribute(&svg, "data-x"), attribute(&svg, "data-y")), ("photos", "residual &quot;r&quot;"));
    assert_eq!(attribute(&svg, "data-name"), "minres &amp; &lt;co&gt;");
    let told: Vec<Vec<f64>> = attribute(&svg, "data-points")
        .split(',')
        .map(|point| point.split(' ').map(|number| number.parse().expect("a number")).collect())
        .collect();
    let values: Vec<(f64, f64)> = told.iter().map(|point| (point[0], point[1])).collect();
    assert_eq!(values, [(1.0, 0.5), (2.0, 0.25), (4.0, 0.125)], "what has no place is not told");
    // Each place is that of a dot.
    for point in told {
        let dot = format!(r#"cx="{:.1}" cy="{:.1}""#, point[2], point[3]);
        assert!(svg.contains(&dot), "{dot}");
    }
    let stems = StemPlot { values: vec![1.0, 0.5], ..StemPlot::default() }.render();
    assert_eq!(attribute(&stems, "data-points").split(',').count(), 2);
}

#[test]
fn each_of_many_methods_has_a_small_plot_of_the_same_axes() {
    let series = |index: usize| Series {
        name: format!("method {index}"),
        points: (1..=5).map(|photo| (f64::from(photo), 1.0 / (photo as f64 * (index + 1) as f64))).collect(),
    };
    let plot = LinePlot { logarithmic: true, series: (0..13).map(series).collect(), ..LinePlot::default() };
    let small = plot.small_multiples();
    assert_eq!(small.len(), 13);
    for (index, (name, svg)) in small.iter().enumerate() {
        assert_eq!(*name, format!("method {index}"));
        assert_eq!(svg.matches("data-points").count(), 1, "one curve tells its values");
        assert_eq!(svg.matches("<polyline").count(), 13, "the others are shadows");
        let ticks = |svg: &str| texts(svg).into_iter().map(|(.., text)| text).collect::<Vec<_>>();
        assert_eq!(ticks(svg), ticks(&small[0].1), "the axes are the same");
    }
}
