//! Reports, as a reader of HTML sees them.

mod markup;
mod report;
mod researchers;
mod sheet;
