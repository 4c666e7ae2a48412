//! What the experiments found of each scheme, for the table at the top of the document.

use bevy_mass_spring::settings::Integrator;

use crate::document::Table;
use crate::simulation::integrators;

/// One cell for a column and a scheme.
#[derive(Default)]
pub struct Findings {
    cells: Vec<(&'static str, Integrator, String)>,
}

impl Findings {
    pub fn note(&mut self, column: &'static str, integrator: Integrator, finding: String) {
        self.cells.push((column, integrator, finding));
    }

    /// A row for each scheme, a column for each experiment, in the order of their findings.
    pub fn table(&self) -> Table {
        let mut columns: Vec<&str> = Vec::new();
        for (column, ..) in &self.cells {
            if !columns.contains(column) {
                columns.push(column);
            }
        }
        let head = ["scheme"].into_iter().chain(columns.iter().copied()).chain(["take it for"]);
        let mut table = Table::new(head);
        for integrator in integrators() {
            let name = integrator.to_string();
            let cell = |column: &&str| {
                let found = self.cells.iter().find(|cell| cell.0 == *column && cell.1 == integrator);
                found.map_or(String::new(), |(.., finding)| finding.clone())
            };
            let cells = columns.iter().map(cell);
            table.row([format!("`{name}`")].into_iter().chain(cells).chain([purpose(&name).to_owned()]));
        }
        table
    }
}

/// What a scheme is for, by its name.
fn purpose(scheme: &str) -> &'static str {
    match scheme {
        "Auto" => "everything, until you know better",
        "SemiImplicitEuler" => "soft nets: cheap, keeps energy",
        "VelocityVerlet" => "exact oscillations over a long time",
        "RungeKutta4" => "the smallest error over a short time",
        "ImplicitEuler" => "stiff nets, large ratios of masses, states of rest",
        "Xpbd" => "stiff nets on a fixed budget of time",
        "SecondOrderTaylor" => "free fall",
        "ExplicitEuler" => "watching it explode",
        _ => "",
    }
}
