//! A workbook of Excel, written row by row.
//!
//! Rows go to temporary files without a name as they come, so that the memory does not grow with their number.

use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use rust_xlsxwriter::{Format, FormatAlign, Workbook, Worksheet, XlsxError};
use serde_json::{Number, Value};

use crate::sweep::{Column, text};

/// Maximum number of rows of a sheet below its header.
pub(crate) const MAX_ROWS: u64 = 1_048_575;

/// Maximum number of columns of a sheet.
pub(crate) const MAX_COLUMNS: usize = 16_384;

/// Maximum number of characters of a cell. Excel allows 32,767 UTF-16 units.
const MAX_CHARACTERS: usize = 16_000;

/// Whole numbers beyond this have digits that Excel loses: it has 15.
const MAX_WHOLE: u64 = 1_000_000_000_000_000;

/// Widths of columns, in characters.
const WIDTHS: std::ops::RangeInclusive<usize> = 9..=40;

/// A sheet of a workbook.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SheetId(usize);

/// The size of a sheet so far.
struct Size {
    rows: u32,
    columns: u16,
}

/// A workbook that is being written.
pub(crate) struct ResultWorkbook {
    workbook: Workbook,
    sheets: Vec<Size>,
    folder: PathBuf,
}

impl ResultWorkbook {
    /// An empty workbook. Its temporary files are in this folder; the system removes them with the process.
    pub(crate) fn new(folder: &Path) -> Result<Self, XlsxError> {
        let mut workbook = Workbook::new();
        workbook.set_tempdir(folder)?;
        // Sizes are not known beforehand. The fastest level makes files a quarter larger, in half the time.
        workbook.use_zip_large_file(true).set_zip_compression_level(1);
        Ok(Self { workbook, sheets: Vec::new(), folder: folder.to_owned() })
    }

    /// Adds a sheet with a bold header that stays visible. Texts of columns in `wide` are wrapped at this width, in characters.
    pub(crate) fn add_sheet(
        &mut self,
        name: &str,
        header: &[String],
        wide: &[(u16, u16)],
    ) -> Result<SheetId, XlsxError> {
        let columns = u16::try_from(header.len()).map_err(|_| XlsxError::RowColumnLimitError)?;
        let sheet = self.workbook.add_worksheet_with_constant_memory()?;
        sheet.set_name(name)?.set_freeze_panes(1, 0)?;
        let bold = Format::new().set_bold();
        for (column, name) in (0..columns).zip(header) {
            sheet.write_string_with_format(0, column, name, &bold)?;
            // Some space for the arrow of the filter.
            let width = (name.chars().count() + 4).clamp(*WIDTHS.start(), *WIDTHS.end());
            sheet.set_column_width(column, width as f64)?;
        }
        let wrapped = Format::new().set_text_wrap().set_align(FormatAlign::Top);
        for (column, width) in wide {
            sheet.set_column_width(*column, *width)?.set_column_format(*column, &wrapped)?;
        }
        self.sheets.push(Size { rows: 0, columns });
        Ok(SheetId(self.sheets.len() - 1))
    }

    /// Appends rows to a sheet.
    pub(crate) fn add_rows(&mut self, sheet: SheetId, columns: &[Column]) -> Result<(), XlsxError> {
        for row in 0..columns.first().map_or(0, |column| column.values().len()) {
            self.add_row(sheet, columns.iter().map(|column| &column.values()[row]))?;
        }
        Ok(())
    }

    /// Appends a row to a sheet: numbers as numbers, words and everything else as text.
    pub(crate) fn add_row<'a>(
        &mut self,
        sheet: SheetId,
        values: impl IntoIterator<Item = &'a Value>,
    ) -> Result<(), XlsxError> {
        let size = &mut self.sheets[sheet.0];
        size.rows += 1;
        let worksheet = self.workbook.worksheet_from_index(sheet.0)?;
        for (column, value) in (0..).zip(values) {
            write_cell(worksheet, (size.rows, column), value)?;
        }
        Ok(())
    }

    /// Completes the workbook, as a temporary file at its beginning.
    pub(crate) fn finish(mut self) -> Result<File, XlsxError> {
        for (index, size) in self.sheets.iter().enumerate() {
            let last = size.columns.saturating_sub(1);
            self.workbook.worksheet_from_index(index)?.autofilter(0, 0, size.rows, last)?;
        }
        let mut file = tempfile::tempfile_in(&self.folder)?;
        let mut writer = BufWriter::new(&file);
        self.workbook.save_to_writer(&mut writer)?;
        writer.flush()?;
        drop(writer);
        file.rewind()?;
        Ok(file)
    }
}

fn write_cell(sheet: &mut Worksheet, (row, column): (u32, u16), value: &Value) -> Result<(), XlsxError> {
    match value {
        Value::Null => return Ok(()),
        Value::Bool(flag) => sheet.write_boolean(row, column, *flag),
        Value::Number(number) => match as_number(number) {
            Some(number) => sheet.write_number(row, column, number),
            None => sheet.write_string(row, column, number.to_string()),
        },
        other => sheet.write_string(row, column, shortened(text(other).unwrap_or_default())),
    }
    .map(|_| ())
}

/// The number as Excel has it; none if it would lose digits.
fn as_number(number: &Number) -> Option<f64> {
    let is_long = |whole: u64| whole > MAX_WHOLE;
    let is_long = number.as_u64().is_some_and(is_long)
        || number.as_i64().is_some_and(|whole| is_long(whole.unsigned_abs()));
    number.as_f64().filter(|_| !is_long)
}

/// A text that fits in a cell.
fn shortened(text: String) -> String {
    match text.char_indices().nth(MAX_CHARACTERS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use calamine::{Data, Reader, Xlsx};
    use serde_json::json;

    use super::*;

    fn read(book: ResultWorkbook) -> Xlsx<std::io::BufReader<File>> {
        Xlsx::new(std::io::BufReader::new(book.finish().unwrap())).unwrap()
    }

    #[test]
    fn cells_are_read_again_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let mut book = ResultWorkbook::new(folder.path()).unwrap();
        let header = ["a", "b"].map(str::to_owned);
        let (one, other) = (
            book.add_sheet("one", &header, &[]).unwrap(),
            book.add_sheet("other", &header, &[(1, 60)]).unwrap(),
        );
        let long = "ä".repeat(40_000);
        let values = [
            json!(0.1),
            json!(-3),
            json!(1e300),
            json!(MAX_WHOLE),
            json!(MAX_WHOLE + 1),
            json!(true),
            json!(null),
            json!("=1+1"),
            json!("<&>\u{1}\n"),
            json!({"constant": 2}),
            json!(long),
        ];
        // Rows of two sheets take turns.
        for value in &values {
            book.add_row(one, [value, &json!("x")]).unwrap();
            book.add_row(other, [value]).unwrap();
        }
        let mut read = read(book);
        assert_eq!(read.sheet_names(), ["one", "other"]);
        for sheet in ["one", "other"] {
            let range = read.worksheet_range(sheet).unwrap();
            assert_eq!(range.get_value((0, 0)), Some(&Data::String("a".to_owned())));
            let cell = |row: u32| range.get_value((row, 0)).cloned().unwrap_or(Data::Empty);
            let word = |text: &str| Data::String(text.to_owned());
            let numbers = [1, 2, 3, 4].map(cell);
            let expected = [0.1, -3.0, 1e300, 1e15].map(Data::Float);
            assert_eq!(numbers, expected);
            assert_eq!(cell(5), word("1000000000000001"), "a number would lose a digit");
            assert_eq!([cell(6), cell(7)], [Data::Bool(true), Data::Empty]);
            assert_eq!(cell(8), word("=1+1"), "text, no formula");
            assert_eq!(cell(9), word("<&>\u{1}\n"));
            assert_eq!(cell(10), word(r#"{"constant":2}"#));
            let Data::String(shortened) = cell(11) else { panic!("{:?}", cell(11)) };
            assert_eq!(shortened, format!("{}…", "ä".repeat(MAX_CHARACTERS)));
        }
        assert!(read.worksheet_formula("one").unwrap().is_empty());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "no file stays");
    }
}
