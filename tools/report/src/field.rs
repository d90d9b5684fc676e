//! What is known of the fields of records.

/// What is known of a field of records; others are shown without.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// What it means, and its unit.
    pub meaning: String,
    /// In which walks it is not zero, such as "with `--fronts on`"; empty: in any.
    pub only: &'static str,
    /// Whether its sum over frames means anything; that of a state does not.
    pub adds_up: bool,
}
