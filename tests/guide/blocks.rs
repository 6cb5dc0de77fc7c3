//! The fenced blocks of a page, and the marks before them.
//!
//! A mark is an HTML comment in the line before the fence:
//!
//! | mark | what it says of the block below |
//! |---|---|
//! | `<!-- not run: REASON -->` | it is not executed, and why |
//! | `<!-- file: NAME -->` | it is the content of a file, which the commands below use |
//! | `<!-- fails: N -->` | it ends with this exit status |
//! | `<!-- says -->` | its lines are in the output of the block before |

use pulldown_cmark::{CodeBlockKind, Event, Parser, Tag, TagEnd};

use crate::pages::Page;

/// The meaning of a mark.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    NotRun(String),
    File(String),
    Fails(i32),
    Says,
}

/// A fenced block.
#[derive(Clone, Debug)]
pub struct Block {
    /// The line of the fence, from 1.
    pub line: usize,
    pub language: String,
    pub text: String,
    pub mark: Option<Mark>,
}

/// The blocks of a page in their order.
pub fn of(page: &Page) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut comment: Option<(usize, Mark)> = None;
    let mut is_open = false;
    for (event, range) in Parser::new(&page.text).into_offset_iter() {
        let line = page.text[..range.start].matches('\n').count() + 1;
        match event {
            Event::Html(html) | Event::InlineHtml(html) => {
                if let Some(mark) = mark(&html) {
                    comment = Some((line, mark));
                }
            }
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(language))) => {
                let mark = comment.take().filter(|(at, _)| at + 1 == line).map(|(_, mark)| mark);
                blocks.push(Block { line, language: language.into_string(), text: String::new(), mark });
                is_open = true;
            }
            Event::Text(text) if is_open => {
                blocks.last_mut().expect("one is open").text.push_str(&text);
            }
            Event::End(TagEnd::CodeBlock) => is_open = false,
            _ => {}
        }
    }
    blocks
}

fn mark(html: &str) -> Option<Mark> {
    let text = html.trim().strip_prefix("<!--")?.strip_suffix("-->")?.trim();
    let (word, rest) = text.split_once(':').map_or((text, ""), |(word, rest)| (word, rest.trim()));
    match word {
        "not run" => Some(Mark::NotRun(rest.to_owned())),
        "file" => Some(Mark::File(rest.to_owned())),
        "fails" => Some(Mark::Fails(rest.parse().unwrap_or_else(|_| panic!("a status: {html}")))),
        "says" => Some(Mark::Says),
        // These blocks of the README are whole steps of .ci/run.
        "main" | "test" => Some(Mark::NotRun(format!("it is a step of .ci/run ({word})"))),
        _ => None,
    }
}

#[test]
fn blocks_are_found_with_their_lines_and_marks() {
    let text = "# A\n\n```sh\nls\n```\n\n<!-- fails: 2 -->\n```sh\nfalse\ntrue\n```\n<!-- file: a.toml -->\n\n```toml\n```\n";
    let blocks = of(&Page { path: "a.md".into(), text: text.into() });
    let found: Vec<_> =
        blocks.iter().map(|block| (block.line, block.language.as_str(), &block.mark)).collect();
    // The last mark is not in the line before its fence.
    assert_eq!(found, [(3, "sh", &None), (8, "sh", &Some(Mark::Fails(2))), (14, "toml", &None)]);
    assert_eq!(blocks[1].text, "false\ntrue\n");
}
