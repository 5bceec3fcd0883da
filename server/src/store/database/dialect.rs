//! The dialect of PostgreSQL: turns the text of a query into statements that it accepts.
//!
//! | in the text | for PostgreSQL | why |
//! |---|---|---|
//! | `?`, `?2` | `$1`, `$2` | its form of parameters |
//! | `;` | two statements | a prepared statement is only one |
//! | `INDEXED BY name` | nothing | it has no such words; the session of the writer prefers indexes |
//! | `CROSS JOIN t ON …` | `JOIN t ON …` | for SQLite, `CROSS` fixes the order of loops; PostgreSQL refuses a condition there |
//! | `json_object(` | `json_build_object(` | the name of the function |
//! | `sqlite_sequence` | `row_numbers` | the table with the highest number of each table, and of the events that were deleted |

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, PoisonError, RwLock};

/// One statement for PostgreSQL.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::store) struct Statement {
    /// Its text.
    pub(in crate::store) text: Arc<str>,
    /// Number of its parameters.
    pub(in crate::store) parameters: usize,
}

type Known = HashMap<String, Arc<[Statement]>>;

/// Texts that were translated before. Their number is that of the queries in the program.
static KNOWN: LazyLock<RwLock<Known>> = LazyLock::new(RwLock::default);

/// The statements of a text that returns.
pub(in crate::store) fn statements(text: &str) -> Arc<[Statement]> {
    if let Some(known) = KNOWN.read().unwrap_or_else(PoisonError::into_inner).get(text) {
        return known.clone();
    }
    let translated: Arc<[Statement]> = translate(text).into();
    KNOWN.write().unwrap_or_else(PoisonError::into_inner).insert(text.to_owned(), translated.clone());
    translated
}

/// The statements of a text.
pub(super) fn translate(text: &str) -> Vec<Statement> {
    let text = text.replace("json_object(", "json_build_object(").replace("sqlite_sequence", "row_numbers");
    split(&join_with_conditions(&without_indexes(&text)))
}

fn without_indexes(text: &str) -> String {
    let mut parts = text.split(" INDEXED BY ");
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        kept.push_str(part.trim_start_matches(|letter: char| letter.is_alphanumeric() || letter == '_'));
    }
    kept
}

/// `JOIN` for each `CROSS JOIN` that has a condition.
fn join_with_conditions(text: &str) -> String {
    let mut parts = text.split("CROSS JOIN ");
    let mut joined = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        // A part ends before the next `CROSS JOIN`, where its own condition has begun or never will.
        joined.push_str(if has_condition(part) { "JOIN " } else { "CROSS JOIN " });
        joined.push_str(part);
    }
    joined
}

/// Whether the table at the start of a text is joined on a condition.
fn has_condition(part: &str) -> bool {
    let mut depth = 0;
    let mut word = String::new();
    for letter in part.chars().chain([' ']) {
        if letter.is_alphanumeric() || letter == '_' {
            word.push(letter);
            continue;
        }
        if depth == 0 {
            match word.as_str() {
                "ON" => return true,
                "WHERE" | "JOIN" | "LEFT" | "GROUP" | "ORDER" | "LIMIT" | "UNION" => return false,
                _ => {}
            }
        }
        word.clear();
        match letter {
            '(' => depth += 1,
            ')' if depth == 0 => return false,
            ')' => depth -= 1,
            ';' => return false,
            _ => {}
        }
    }
    false
}

/// Numbers the parameters, and splits at semicolons. Texts in quotes stay as they are.
fn split(text: &str) -> Vec<Statement> {
    let (mut statements, mut current) = (Vec::new(), String::with_capacity(text.len() + 16));
    let (mut next, mut highest, mut is_quoted) = (1, 0, false);
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '\'' => {
                is_quoted = !is_quoted;
                current.push(letter);
            }
            _ if is_quoted => current.push(letter),
            '?' => {
                let mut digits = String::new();
                while let Some(digit) = letters.next_if(char::is_ascii_digit) {
                    digits.push(digit);
                }
                let number = digits.parse().unwrap_or(next);
                next += usize::from(digits.is_empty());
                highest = highest.max(number);
                current.push_str(&format!("${number}"));
            }
            ';' => {
                push(&mut statements, &mut current, &mut highest);
                next = 1;
            }
            _ => current.push(letter),
        }
    }
    push(&mut statements, &mut current, &mut highest);
    statements
}

fn push(statements: &mut Vec<Statement>, current: &mut String, highest: &mut usize) {
    let text = std::mem::take(current);
    let parameters = std::mem::take(highest);
    if !text.trim().is_empty() {
        statements.push(Statement { text: text.trim().into(), parameters });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(text: &str) -> Vec<(String, usize)> {
        translate(text).into_iter().map(|it| (it.text.to_string(), it.parameters)).collect()
    }

    fn one(text: &str) -> String {
        let mut texts = texts(text);
        assert_eq!(texts.len(), 1, "{texts:?}");
        texts.remove(0).0
    }

    #[test]
    fn parameters_are_numbered_in_each_statement() {
        assert_eq!(
            texts("UPDATE a SET b = ? WHERE c = ?; DELETE FROM d WHERE e = ? AND f = '?;'"),
            [
                ("UPDATE a SET b = $1 WHERE c = $2".to_owned(), 2),
                ("DELETE FROM d WHERE e = $1 AND f = '?;'".to_owned(), 1)
            ]
        );
        assert_eq!(texts("SELECT ?2, ?1, ?12"), [("SELECT $2, $1, $12".to_owned(), 12)]);
    }

    #[test]
    fn cross_joins_with_a_condition_are_plain_ones() {
        let text = "SELECT 1 FROM a CROSS JOIN b me CROSS JOIN c ON c.d IN (SELECT 1 WHERE e) WHERE f";
        assert_eq!(one(text), text.replace("CROSS JOIN c", "JOIN c"));
        for same in [
            "SELECT 1 FROM a CROSS JOIN b WHERE c",
            "SELECT (SELECT 1 FROM a CROSS JOIN b) FROM c JOIN d ON e",
            "SELECT 1 FROM a CROSS JOIN b LEFT JOIN c ON d",
            "SELECT 1 FROM a CROSS JOIN b(c) d",
        ] {
            assert_eq!(one(same), same);
        }
    }

    #[test]
    fn hints_and_names_of_sqlite_are_replaced() {
        assert_eq!(one("SELECT 1 FROM a INDEXED BY a_by_b WHERE b"), "SELECT 1 FROM a WHERE b");
        assert_eq!(one("SELECT json_object('a', b)"), "SELECT json_build_object('a', b)");
        assert_eq!(one("SELECT seq FROM sqlite_sequence"), "SELECT seq FROM row_numbers");
    }
}
