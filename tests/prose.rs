//! Checks of the prose of user pages: short sentences with named subjects.
//!
//! Code, headings and comments are not checked. In cells of tables, only the length of sentences is checked.

use std::path::Path;

/// Maximum number of words of a sentence.
const LONGEST: usize = 35;
/// Maximum of the mean number of words per sentence of a page.
const MEAN: f64 = 20.0;

/// First words of statements without a named subject; questions may start with them.
const OPENINGS: &[&str] = &["What", "Which", "Such", "So", "That", "Whoever", "Who"];

/// Phrases with a plainer alternative.
const PHRASES: &[&str] = &[
    "lest",
    "but for",
    "what comes out",
    "what came out",
    "what is there",
    "what there is",
    "which is what",
    "as it stands",
    "stands in",
    "a row a job",
    "a file a",
    "greatest",
    "anew",
];

/// Pages to which the rules apply. The reference of the HTTP API and the changelog are exempt.
fn pages() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = ["README.md", "ARCHITECTURE.md", "deploy/README.md"].map(str::to_owned).to_vec();
    let mut folders = vec!["docs".to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root.join(&folder)).expect("a folder") {
            let entry = entry.expect("an entry");
            let name = format!("{folder}/{}", entry.file_name().into_string().expect("UTF-8"));
            if entry.path().is_dir() {
                folders.push(name);
            } else if name.ends_with(".md") && name != "docs/SUMMARY.md" {
                found.push(name);
            }
        }
    }
    found
}

/// The sentences of a page.
fn sentences(page: &str) -> Vec<String> {
    let mut paragraphs = vec![String::new()];
    let (mut is_code, mut is_comment) = (false, false);
    for line in page.lines() {
        let line = line.trim();
        if line.starts_with("```") {
            is_code = !is_code;
        }
        is_comment |= line.starts_with("<!--");
        let is_left_out =
            is_code || is_comment || ["```", "|", "#", "<"].iter().any(|mark| line.starts_with(mark));
        let item = line
            .strip_prefix("- ")
            .or_else(|| line.split_once(". ").filter(|(n, _)| n.parse::<u8>().is_ok()).map(|(_, rest)| rest));
        if line.is_empty() || is_left_out || item.is_some() {
            paragraphs.push(String::new());
        }
        if !is_left_out {
            let paragraph = paragraphs.last_mut().expect("one");
            *paragraph += item.unwrap_or(line);
            paragraph.push(' ');
        }
        is_comment &= !line.ends_with("-->");
    }
    paragraphs.iter().flat_map(|paragraph| split(paragraph)).collect()
}

/// The sentences of a paragraph.
fn split(paragraph: &str) -> Vec<String> {
    let text = plain(paragraph);
    let (mut found, mut rest) = (Vec::new(), text.trim());
    while !rest.is_empty() {
        let end = end_of_sentence(rest);
        found.push(rest[..end].trim().to_owned());
        rest = rest[end..].trim_start();
    }
    found
}

/// The sentences in cells of tables, where semicolons separate remarks.
fn sentences_of_tables(page: &str) -> Vec<String> {
    let rows = page.lines().filter(|line| line.starts_with('|'));
    rows.flat_map(|row| row.split(['|', ';']).flat_map(split).collect::<Vec<_>>()).collect()
}

/// End of the first sentence: a mark, followed by the end of the text, or by a space and a capital letter or an opening mark.
fn end_of_sentence(text: &str) -> usize {
    for (at, mark) in text.char_indices().filter(|(_, c)| ".!?".contains(*c)) {
        let next = &text[at + mark.len_utf8()..];
        let next = next.trim_start_matches(['*', ')', '"']);
        let opens = |c: char| c.is_uppercase() || "*\"(".contains(c);
        if next.trim().is_empty() || next.starts_with(' ') && next.trim_start().starts_with(opens) {
            return text.len() - next.len();
        }
    }
    text.len()
}

/// The text without Markdown: links by their text, code as one word.
fn plain(paragraph: &str) -> String {
    let mut text = String::new();
    for (number, part) in paragraph.split('`').enumerate() {
        text += if number % 2 == 0 { part } else { "Code" };
    }
    while let Some((before, after)) = text.split_once("](") {
        let rest = after.split_once(')').map_or("", |(_, rest)| rest);
        text = format!("{}{rest}", before.replace("![", "").replace('[', ""));
    }
    text.replace(['<', '>'], "")
}

fn words(sentence: &str) -> usize {
    sentence.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count()
}

/// Violations of the rules on a page.
fn faults(page: &str) -> Vec<String> {
    let sentences = sentences(page);
    let mut faults = Vec::new();
    for sentence in &sentences {
        let count = words(sentence);
        if count > LONGEST {
            faults.push(format!("{count} words: {sentence}"));
        }
        let first = sentence.trim_start_matches(['*', '(']).split(|c: char| !c.is_alphanumeric()).next();
        if !sentence.contains('?') && OPENINGS.contains(&first.unwrap_or_default()) {
            faults.push(format!("the subject has no name: {sentence}"));
        }
        let padded = format!(" {} ", sentence.to_lowercase().replace([',', '.', ';', ':'], " "));
        if let Some(phrase) = PHRASES.iter().find(|phrase| padded.contains(&format!(" {phrase} "))) {
            faults.push(format!("`{phrase}`: {sentence}"));
        }
    }
    let is_long = |sentence: &String| words(sentence) > LONGEST;
    let long = sentences_of_tables(page).into_iter().filter(is_long);
    faults.extend(long.map(|sentence| format!("{} words in a table: {sentence}", words(&sentence))));
    let all: usize = sentences.iter().map(|sentence| words(sentence)).sum();
    let mean = all as f64 / sentences.len().max(1) as f64;
    if mean > MEAN {
        faults.push(format!("{mean:.1} words a sentence in the mean of {}", sentences.len()));
    }
    faults
}

#[test]
fn every_page_follows_the_rules() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let pages = pages();
    assert!(pages.len() > 30, "{pages:?}");
    let mut all = Vec::new();
    for name in pages {
        let text = std::fs::read_to_string(root.join(&name)).expect("a page");
        all.extend(faults(&text).into_iter().map(|fault| format!("{name}: {fault}")));
    }
    assert!(all.is_empty(), "{} faults:\n{}", all.len(), all.join("\n"));
}

#[test]
fn page_is_split_into_sentences() {
    let page = "# A heading that counts for nothing\n\nOne of Fig. 5, 2.5 mm. Two [with a link](x.md#y)\ngoes `on here` now!\n\n\
        | a | table |\n\n```sh\ncode. Code.\n```\n<!-- a comment. -->\n- An item. Another one\n1. A step.\n";
    let found = sentences(page);
    let wanted =
        ["One of Fig. 5, 2.5 mm.", "Two with a link goes Code now!", "An item.", "Another one", "A step."];
    assert_eq!(found, wanted);
    assert_eq!(words(&found[1]), 7);
}

#[test]
fn violations_of_the_rules_are_found() {
    let long = "word ".repeat(LONGEST + 1);
    assert_eq!(faults(&long).len(), 2, "too long, and too long in the mean");
    assert_eq!(faults(&format!("| a cell | {long}|\n")).len(), 1, "too long in a table");
    assert_eq!(faults("What comes here is short.").len(), 1);
    assert_eq!(faults("Which gate is best? It is this one.").len(), 0);
    assert_eq!(faults("Keep it shut lest it leaks.").len(), 1);
    assert_eq!(faults("It is the latest one.").len(), 0);
}
