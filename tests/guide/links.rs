//! Every link within the repository leads to a file, and to a heading of it.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

use crate::pages::{self, Page, root};

fn parser(text: &str) -> Parser<'_> {
    Parser::new_ext(text, Options::ENABLE_TABLES)
}

/// The links and pictures of a page with their lines.
fn links(page: &Page) -> Vec<(usize, String)> {
    let events = parser(&page.text).into_offset_iter();
    let links = events.filter_map(|(event, range)| match event {
        Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
            Some((page.text[..range.start].matches('\n').count() + 1, dest_url.into_string()))
        }
        _ => None,
    });
    links.collect()
}

/// The anchors of a page: its headings, as mdBook and code hosts name them, and every `<a id="…">`.
fn anchors(text: &str) -> Vec<String> {
    let mut anchors: Vec<String> = Vec::new();
    let mut heading: Option<String> = None;
    let mut seen: HashMap<String, usize> = HashMap::new();
    for event in parser(text) {
        match event {
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::Text(part) | Event::Code(part) => {
                if let Some(heading) = &mut heading {
                    heading.push_str(&part);
                }
            }
            Event::End(TagEnd::Heading(_)) => {
                let name = slug(&heading.take().unwrap_or_default());
                let count = seen.entry(name.clone()).or_default();
                anchors.push(if *count == 0 { name } else { format!("{name}-{count}") });
                *count += 1;
            }
            Event::Html(html) | Event::InlineHtml(html) => {
                anchors.extend(
                    html.split("id=\"").skip(1).filter_map(|rest| Some(rest.split('"').next()?.to_owned())),
                );
            }
            _ => {}
        }
    }
    anchors
}

fn slug(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// The paths that a page includes, relative to its folder.
fn includes(text: &str) -> Vec<&str> {
    let parts = text.split("{{#include ").skip(1);
    parts.filter_map(|rest| rest.split("}}").next()).map(str::trim).collect()
}

/// The text of a page, and of what it includes.
fn whole(path: &Path) -> String {
    let text = pages::read(&path.to_string_lossy());
    let folder = path.parent().expect("a page is in a folder");
    let included: Vec<String> =
        includes(&text).into_iter().map(|path| whole(&plain(&folder.join(path)))).collect();
    text + &included.concat()
}

/// A path without `..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    plain
}

#[test]
fn every_link_leads_somewhere() {
    let mut checked = 0;
    for page in pages::all().into_iter().chain(pages::others()) {
        for (line, link) in links(&page) {
            if link.starts_with("https://") {
                continue;
            }
            let (path, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let folder = page.path.parent().expect("a page is in a folder");
            let target = if path.is_empty() { page.path.clone() } else { plain(&folder.join(path)) };
            assert!(root().join(&target).exists(), "{}: {link} leads nowhere", page.at(line));
            let is_of_guide = page.path.starts_with("guide");
            assert!(
                !is_of_guide || target.starts_with("guide/src"),
                "{}: {link} is not in the built guide",
                page.at(line)
            );
            if !anchor.is_empty() {
                assert!(
                    anchors(&whole(&target)).iter().any(|of| of == anchor),
                    "{}: no heading {link}",
                    page.at(line)
                );
            }
            checked += 1;
        }
    }
    assert!(checked > 100, "{checked}");
}

#[test]
fn every_file_that_a_page_includes_is_there() {
    let mut included = 0;
    for page in pages::all() {
        let folder = page.path.parent().expect("a page is in a folder");
        for path in includes(&page.text) {
            assert!(root().join(folder).join(path).is_file(), "{}: {path}", page.path.display());
            included += 1;
        }
    }
    assert!(included > 5, "{included}");
}

#[test]
fn anchors_are_those_of_mdbook() {
    let text = "# The `A x` of it: now\n\n## Runs\n\n## Runs\n\n<a id=\"own\"></a>\n";
    assert_eq!(anchors(text), ["the-a-x-of-it-now", "runs", "runs-1", "own"]);
}
