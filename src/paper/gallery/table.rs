//! All numbers as a page in Markdown, to be kept beside a release: the guide's page on the paper's figures is made so.

use std::fmt::Write;

use super::numbers::{digits, is_judged};
use crate::paper::{Check, Figure, Limit, Reproduced};

/// The page. `quick` says that the figures are smaller than the paper's, `command` what made them.
pub(super) fn markdown(made: &[Reproduced], quick: bool, command: &str) -> String {
    let mut page = String::from("# The paper's figures, held to bounds\n\n");
    let version = env!("CARGO_PKG_VERSION");
    // Writing to a string cannot fail, here and below.
    let _ = writeln!(
        page,
        "krylux {version} made this page by `{command}`, which leaves it as `figures.md` in the run's folder, beside `report.html` with the \
         pictures and plots. The paper is O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*. What it says is \
         told in our words; bounds are ours where it gives none. *Ideal* photos have no devices' faults. *Virtual* ones are of the projector \
         and camera of `realistic.toml`, calibrated from captures. **Bold** numbers miss their bound. A frame is one exposure of the virtual \
         camera: patterns of both signs, bit planes, takes, exposures, black, white and sentinels are counted, calibration is not.\n"
    );
    if quick {
        page += "This is a quick run of small pictures: it shows that everything works, not how well.\n\n";
    }
    page += "| figure | ideal | virtual | photos | frames |\n|---|---|---|---|---|\n";
    let figures = || Figure::ALL.into_iter().filter(|&figure| made.iter().any(|one| one.figure == figure));
    for figure in figures() {
        let [ideal, virtual_rig] = rigs(made, figure);
        let photos = ideal.or(virtual_rig).map_or(0, |one| one.photos);
        let frames = virtual_rig.map_or("–".into(), |one| one.frames.to_string());
        let _ = writeln!(
            page,
            "| {} | {} | {} | {photos} | {frames} |",
            figure.title(),
            met(ideal.into_iter()),
            met(virtual_rig.into_iter())
        );
    }
    let of_rig = |at: usize| met(figures().filter_map(|figure| rigs(made, figure)[at]));
    let _ = writeln!(page, "| **All** | **{}** | **{}** | | |", of_rig(0), of_rig(1));
    for figure in figures() {
        section(&mut page, figure, rigs(made, figure));
    }
    page
}

/// The figure by the ideal and by the virtual rig.
fn rigs(made: &[Reproduced], figure: Figure) -> [Option<&Reproduced>; 2] {
    use crate::paper::Rig;
    [Rig::Ideal, Rig::Virtual].map(|rig| made.iter().find(|one| one.figure == figure && one.rig == rig))
}

/// How many bounds are met, of how many.
fn met<'a>(made: impl Iterator<Item = &'a Reproduced>) -> String {
    let judged: Vec<&Check> = made.flat_map(|one| &one.checks).filter(|check| is_judged(check)).collect();
    let met = judged.iter().filter(|check| check.is_met()).count();
    if judged.is_empty() { "–".into() } else { format!("{met} of {}", judged.len()) }
}

fn section(page: &mut String, figure: Figure, rigs: [Option<&Reproduced>; 2]) {
    let checks = rigs.map(|one| one.map_or(&[][..], |one| &one.checks));
    let setting = rigs.iter().flatten().next().map_or("", |one| one.setting.as_str());
    let _ = writeln!(page, "\n## {}\n\n{}\n\nHere: {setting}.\n", figure.title(), figure.statement());
    *page += "| number | wanted | ideal | virtual |\n|---|---|---|---|\n";
    // Each number once, in the order of the first rig; some are of one rig only.
    let mut rows: Vec<&Check> = checks[0].iter().collect();
    rows.extend(checks[1].iter().filter(|check| find(checks[0], &check.what).is_none()));
    for row in rows {
        let [ideal, virtual_rig] = checks.map(|of| find(of, &row.what).map_or("–".into(), value));
        let _ = writeln!(page, "| {} | {} | {ideal} | {virtual_rig} |", row.what, wanted(row));
    }
    let mut missed = String::new();
    for (name, of) in ["ideal", "virtual"].into_iter().zip(checks) {
        for check in of.iter().filter(|check| !check.is_met()) {
            let cause = if check.cause().is_empty() { "The cause is not proven." } else { check.cause() };
            let _ = writeln!(missed, "* *{}*, {name}: {cause}", check.what);
        }
    }
    if !missed.is_empty() {
        let _ = writeln!(page, "\nWhere it misses its bounds, and why:\n\n{}", missed.trim_end());
    }
}

fn find<'a>(checks: &'a [Check], what: &str) -> Option<&'a Check> {
    checks.iter().find(|check| check.what == what)
}

fn wanted(check: &Check) -> String {
    match check.limit {
        Limit::AtLeast(limit) => format!("at least {}", digits(limit)),
        Limit::AtMost(limit) => format!("at most {}", digits(limit)),
        Limit::Stated => String::new(),
    }
}

fn value(check: &Check) -> String {
    let value = digits(check.value);
    if check.is_met() { value } else { format!("**{value}**") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::Rig;

    fn of(rig: Rig, checks: Vec<Check>) -> Reproduced {
        Reproduced {
            checks,
            setting: "a wall".into(),
            photos: 50,
            frames: 120,
            ..Reproduced::of(Figure::Fig5, rig)
        }
    }

    #[test]
    fn numbers_of_both_rigs_stand_in_one_row_and_misses_have_their_cause() {
        let nearer = |value: f64| Check::at_least("nearer", value, 0.99).because("noise");
        let made = [
            of(Rig::Ideal, vec![nearer(1.0)]),
            of(Rig::Virtual, vec![nearer(0.5), Check::stated("frames of it", 7.0)]),
        ];
        let page = markdown(&made, false, "krylux reproduce fig5 --rig both");
        for line in [
            "| Figure 5: pixels by their eigenvector entries | 1 of 1 | 0 of 1 | 50 | 120 |",
            "| **All** | **1 of 1** | **0 of 1** | | |",
            "| nearer | at least 0.99 | 1 | **0.5** |",
            "| frames of it |  | – | 7 |",
            "* *nearer*, virtual: noise",
        ] {
            assert!(page.lines().any(|found| found == line), "{line}\n{page}");
        }
        assert!(!page.contains("quick"));
    }

    #[test]
    fn one_rig_leaves_the_column_of_the_other_empty() {
        let made = [of(Rig::Virtual, vec![Check::at_most("off", 2.0, 1.0)])];
        let page = markdown(&made, true, "krylux reproduce fig5 --quick");
        assert!(page.contains("| off | at most 1 | – | **2** |"), "{page}");
        assert!(
            page.contains("* *off*, virtual: The cause is not proven.") && page.contains("quick run"),
            "{page}"
        );
    }
}
