//! Plain text tables: a header, a rule, and columns aligned by their content.

use roost_api::printable::one_line;

/// A table of texts.
#[derive(Debug)]
pub struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows; the header gives the columns.
    pub fn new<S: Into<String>>(header: impl IntoIterator<Item = S>) -> Self {
        Self { header: header.into_iter().map(cell).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(cell).collect());
    }

    /// Whether the table has no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Whether a column has numbers only; such columns are aligned to the right.
    fn is_numeric(&self, column: usize) -> bool {
        let mut cells =
            self.rows.iter().filter_map(|row| row.get(column)).filter(|cell| *cell != "–").peekable();
        cells.peek().is_some() && cells.all(|cell| cell.parse::<f64>().is_ok())
    }
}

/// The text of a cell, without line ends.
fn cell(text: impl Into<String>) -> String {
    one_line(&text.into()).into_owned()
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.chain([&self.header[column]]).map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let columns: Vec<_> =
            (0..self.header.len()).map(|column| (width(column), self.is_numeric(column))).collect();
        let rule: Vec<_> = columns.iter().map(|(width, _)| "─".repeat(*width)).collect();
        for line in [&self.header, &rule].into_iter().chain(&self.rows) {
            let cells = line.iter().zip(&columns).map(|(cell, &(width, is_numeric))| {
                if is_numeric { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
            });
            let text = cells.collect::<Vec<_>>().join("  ");
            writeln!(f, "{}", text.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_and_numbers_to_the_right() {
        let mut table = Table::new(["gate", "regime", "kg"]);
        table.row(["0.045", "no_flow", "–"]);
        table.row(["0.06", "constant", "33.2"]);
        let expected = [
            " gate  regime      kg",
            "─────  ────────  ────",
            "0.045  no_flow      –",
            " 0.06  constant  33.2",
            "",
        ];
        assert_eq!(table.to_string(), expected.join("\n"));
    }
}
