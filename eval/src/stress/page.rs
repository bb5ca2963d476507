//! The table of `stress`.

use std::fmt::Write as _;

use anyhow::{Result, ensure};
use serde::Serialize;

use super::{
    Case, SUBJECTS,
    property::{Property, number},
};
use crate::report::{Folder, table};

/// A line of `stress.csv`.
#[derive(Debug, Serialize)]
struct Row {
    case: &'static str,
    property: String,
    value: f64,
    bound: String,
    holds: bool,
}

/// Writes all files; the result is the page's tables.
///
/// # Errors
/// When a file cannot be written, and then when something does not hold.
pub(super) fn write(folder: &Folder, measured: &[(&Case, Vec<Property>)]) -> Result<String> {
    let rows: Vec<Row> = (measured.iter())
        .flat_map(|(case, properties)| properties.iter().map(|property| row(case, property)))
        .collect();
    folder.csv(&rows)?;
    let broken = rows.iter().filter(|row| !row.holds).count();
    let sum = format!(
        "{} of {} properties hold.\n",
        rows.len() - broken,
        rows.len()
    );
    let body = body(measured) + &sum;
    folder.page("Extreme and stiff cases", &body)?;
    ensure!(
        broken == 0,
        "{broken} of {} properties do not hold, see {}",
        rows.len(),
        folder.file(".md").display()
    );
    Ok(body)
}

fn row(case: &Case, property: &Property) -> Row {
    Row {
        case: case.name,
        property: property.name(),
        value: property.value,
        bound: property.bound(),
        holds: property.holds(),
    }
}

fn body(measured: &[(&Case, Vec<Property>)]) -> String {
    let mut body = String::new();
    for (subject, cases) in SUBJECTS {
        let of_subject: Vec<_> = (measured.iter())
            .filter(|(case, _)| cases.iter().any(|other| other.name == case.name))
            .collect();
        if of_subject.is_empty() {
            continue;
        }
        // Writing to a String cannot fail.
        let _ = writeln!(body, "## {subject}\n");
        for (case, _) in &of_subject {
            let _ = writeln!(body, "- `{}`: {}", case.name, case.what);
        }
        let lines = of_subject.iter().flat_map(|(case, properties)| {
            properties.iter().map(|property| {
                let holds = if property.holds() { "yes" } else { "**no**" };
                vec![
                    format!("`{}`", case.name),
                    property.name(),
                    number(property.value),
                    property.bound(),
                    holds.to_owned(),
                ]
            })
        });
        let columns = ["case", "property", "value", "bound", "holds"];
        let _ = writeln!(body, "\n{}", table(&columns, lines));
    }
    body
}
