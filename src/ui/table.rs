//! Plain text tables: a header, a rule, columns aligned by what they hold.

use roost_api::printable::one_line;

/// A table in the making.
#[derive(Debug)]
pub(crate) struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new<S: Into<String>>(header: impl IntoIterator<Item = S>) -> Self {
        Self { header: header.into_iter().map(cell).collect(), rows: Vec::new() }
    }

    pub(crate) fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(cell).collect());
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Columns of numbers to the right, all others to the left.
    fn is_numeric(&self, column: usize) -> bool {
        let mut cells =
            self.rows.iter().filter_map(|row| row.get(column)).filter(|cell| *cell != "–").peekable();
        cells.peek().is_some() && cells.all(|cell| cell.parse::<f64>().is_ok())
    }
}

/// What stands in a cell: it never breaks its line.
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
    fn columns_line_up_and_numbers_stand_right() {
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
