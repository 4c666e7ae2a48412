//! Markdown: sections, tables, numbers.

use std::fmt::Write;

/// The text of one experiment.
#[derive(Default)]
pub struct Section {
    pub text: String,
}

impl Section {
    pub fn titled(title: &str) -> Self {
        Self { text: format!("## {title}\n\n") }
    }

    /// A paragraph, broken into lines of at most 110 characters.
    pub fn paragraph(&mut self, text: &str) {
        self.wrap(text, "");
        self.text.push_str("\n\n");
    }

    /// Items that begin with `- `.
    pub fn list(&mut self, items: &[String]) {
        for item in items {
            self.wrap(item, "  ");
            self.text.push('\n');
        }
        self.text.push('\n');
    }

    fn wrap(&mut self, text: &str, indent: &str) {
        let mut width = 0;
        for word in text.split_whitespace() {
            let length = word.chars().count();
            if width > 0 && width + 1 + length > 110 {
                self.text.push('\n');
                self.text.push_str(indent);
                width = indent.len();
            } else if width > 0 {
                self.text.push(' ');
                width += 1;
            }
            self.text.push_str(word);
            width += length;
        }
    }

    pub fn picture(&mut self, caption: &str, file: &str) {
        let _ = write!(self.text, "![{caption}](images/conformance/{file})\n\n");
    }

    pub fn table(&mut self, table: Table) {
        self.text.push_str(&table.text);
        self.text.push('\n');
    }
}

/// A table, row by row.
pub struct Table {
    text: String,
}

impl Table {
    pub fn new<S: AsRef<str>>(columns: impl IntoIterator<Item = S>) -> Self {
        let mut table = Self { text: String::new() };
        let count = table.row(columns);
        table.row(std::iter::repeat_n("---", count));
        table
    }

    /// Adds a row; returns its number of cells.
    pub fn row<S: AsRef<str>>(&mut self, cells: impl IntoIterator<Item = S>) -> usize {
        let cells: Vec<S> = cells.into_iter().collect();
        for cell in &cells {
            let _ = write!(self.text, "| {} ", cell.as_ref());
        }
        self.text.push_str("|\n");
        cells.len()
    }
}

/// Three significant digits.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    if size == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{value:.1e}");
    }
    let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
    format!("{value:.decimals$}")
}

/// Three significant digits with a sign.
pub fn signed(value: f64) -> String {
    with_sign(value, &number(value))
}

/// Three decimals with a sign.
pub fn brief(value: f64) -> String {
    with_sign(value, &format!("{value:.3}"))
}

fn with_sign(value: f64, text: &str) -> String {
    if value > 0.0 { format!("+{text}") } else { text.replace('-', "−") }
}
