//! Times of the turns, and the tables of rates.

use super::common::median;
use super::judge::Case;
use super::{Column, SETS};

/// A mode's seconds, turn by turn.
#[derive(Default)]
pub struct Mode {
    pub name: String,
    /// Of the processor, one thread.
    pub processor: Vec<f64>,
    /// By the clock, all threads.
    pub wall: Vec<f64>,
}

/// A column's times with one set of rays.
pub struct Timed {
    pub title: String,
    pub modes: Vec<Mode>,
    /// The rays on whose hit it and ours differ, of the mode where most do.
    pub apart: Vec<Case>,
    /// In how many of them ours and it find what f64 finds.
    pub right: [usize; 2],
}

impl Timed {
    pub fn new(column: &Column) -> Self {
        let modes = column.modes.iter().map(|name| Mode { name: name.clone(), ..Mode::default() });
        Self { title: column.title.clone(), modes: modes.collect(), apart: Vec::new(), right: [0; 2] }
    }

    /// The times of the mode with the least median.
    pub fn best(&self, times: impl Fn(&Mode) -> &Vec<f64>) -> &[f64] {
        let all = self.modes.iter().map(times);
        all.min_by(|a, b| median((*a).clone()).total_cmp(&median((*b).clone()))).map_or(&[], |best| best)
    }
}

/// All columns' times with one set of rays in one city; the first column is ours.
pub struct Row {
    pub city: String,
    pub triangles: u32,
    pub set: usize,
    /// Rays that are traced.
    pub traced: usize,
    pub columns: Vec<Timed>,
}

impl Row {
    /// Million rays a second.
    pub fn rate(&self, times: &[f64]) -> f64 {
        self.traced as f64 / median(times.to_vec()) / 1e6
    }

    /// The rate of our best mode by that of another's, the median of the ratios of the turns.
    fn ratio(&self, column: &Timed, times: fn(&Mode) -> &Vec<f64>) -> f64 {
        let (own, other) = (self.columns[0].best(times), column.best(times));
        median(own.iter().zip(other).map(|(own, other)| other / own).collect())
    }

    fn with_ratio(&self, k: usize, rates: String, times: fn(&Mode) -> &Vec<f64>) -> String {
        if k == 0 { rates } else { format!("{rates} ({:.2})", self.ratio(&self.columns[k], times)) }
    }

    fn print(&self, cell: impl Fn(usize, &Timed) -> String) {
        let cells: Vec<String> = self.columns.iter().enumerate().map(|(k, column)| cell(k, column)).collect();
        println!("| {} | {} | {} |", self.city, SETS[self.set], cells.join(" | "));
    }
}

fn head(title: &str, columns: impl Iterator<Item = String>) {
    let columns: Vec<String> = columns.collect();
    println!("\n{title}\n");
    println!("| city | rays | {} |", columns.join(" | "));
    println!("| --- | --- |{}", " --- |".repeat(columns.len()));
}

/// Rates of one thread and of all, behind those of others in brackets our rate by theirs, best modes both; and how far
/// hits agree.
pub fn print(rows: &[Row], threads: usize) {
    let Some(first) = rows.first() else { return };
    let titles = || first.columns.iter().map(|column| column.title.clone());
    let modes = |column: &Timed| column.modes.iter().map(|mode| mode.name.clone()).collect::<Vec<_>>().join(" / ");
    let with_modes = first.columns.iter().map(|column| format!("{}, {}", column.title, modes(column)));
    head("Million rays a second of processor time, one thread:", with_modes);
    for row in rows {
        row.print(|k, column| {
            let rates = column.modes.iter().map(|mode| format!("{:.2}", row.rate(&mode.processor)));
            row.with_ratio(k, rates.collect::<Vec<_>>().join(" / "), |mode| &mode.processor)
        });
    }
    head(&format!("Million rays a second by the clock, {threads} threads, best modes:"), titles());
    for row in rows {
        row.print(|k, column| {
            let rate = row.rate(column.best(|mode| &mode.wall));
            row.with_ratio(k, format!("{rate:.2}"), |mode| &mode.wall)
        });
    }
    let title =
        "Rays on whose hit they and ours differ, the worst mode; of them those where ours, and they, are right in f64:";
    head(title, titles().skip(1));
    for row in rows {
        let cell = |column: &Timed| format!("{}: {}, {}", column.apart.len(), column.right[0], column.right[1]);
        let cells: Vec<String> = row.columns[1..].iter().map(cell).collect();
        println!("| {} | {} | {} |", row.city, SETS[row.set], cells.join(" | "));
    }
}
