//! What the experiments found of each scheme, for the table at the top of the document.

use bevy_mass_spring::settings::Integrator;

use crate::document::Table;
use crate::simulation::integrators;

pub const ORDER: &str = "order";
pub const ORDER_ON_GROUND: &str = "order in contact";
pub const ENERGY: &str = "energy of a pendulum after 20 s";
pub const STIFF_SWING: &str = "10 kg on a rope of 1e6 N/m: energy left after 20 s";
pub const STIFFEST: &str = "sheet of 51²: within the bar up to";
pub const HEAVY: &str = "100,000 kg on 1 kg links: off by";
pub const STRETCH: &str = "1,000 kg at 1e8 N/m: stretch";
pub const ROPE: &str = "rope of 1,000: ms a tick for 30 mm";
pub const CLOTH: &str = "cloth of 32²: ms a tick for 30 mm";

/// One cell for a column and a scheme.
#[derive(Default)]
pub struct Findings {
    cells: Vec<(&'static str, Integrator, String)>,
}

impl Findings {
    pub fn note(&mut self, column: &'static str, integrator: Integrator, finding: String) {
        self.cells.push((column, integrator, finding));
    }

    fn found(&self, column: &str, integrator: Integrator) -> &str {
        let cell = self.cells.iter().find(|cell| cell.0 == column && cell.1 == integrator);
        cell.map_or("", |(.., finding)| finding)
    }

    /// What follows for a user.
    pub fn advice(&self) -> Vec<String> {
        let of = |column, integrator| self.found(column, integrator);
        vec![
            format!(
                "- **Leave it at `Auto`.** It weighs the stability bound of the net against the cost of the \
                 implicit scheme: the sheet stays within its bar up to {}, the pendulum's energy changes by {}. Name \
                 a scheme to know exactly what runs, or for what it is best at:",
                of(STIFFEST, Integrator::Auto),
                of(ENERGY, Integrator::Auto)
            ),
            format!(
                "- **`SemiImplicitEuler`** while its bound asks for tens of substeps: the cheapest motion that \
                 looks right, with the pendulum's energy within {}.",
                of(ENERGY, Integrator::SemiImplicitEuler)
            ),
            format!(
                "- **`VelocityVerlet`** and **`RungeKutta4`** where the motion must be exact: orders {} and {}; \
                 with the first the energy wavers and does not drift, the second has the smallest errors and slowly \
                 damps what is fast.",
                of(ORDER, Integrator::VelocityVerlet),
                of(ORDER, Integrator::RungeKutta4)
            ),
            format!(
                "- **`TrBdf2`** where stiffness or masses leave no other choice: order {} ({} while something touches), and \
                 {} of the energy of a stiff swing is left after 20 s, where `ImplicitEuler` leaves {}.",
                of(ORDER, Integrator::TrBdf2),
                of(ORDER_ON_GROUND, Integrator::TrBdf2),
                of(STIFF_SWING, Integrator::TrBdf2),
                of(STIFF_SWING, Integrator::ImplicitEuler)
            ),
            format!(
                "- **`ImplicitEuler`** for states of rest: {} off with a hundred tons on links of a kilogram, {} of stretch in the stiff strand, in one step a \
                 tick. The price is energy ({} of the pendulum's in 20 s) and order {}.",
                of(HEAVY, Integrator::ImplicitEuler),
                of(STRETCH, Integrator::ImplicitEuler),
                of(ENERGY, Integrator::ImplicitEuler),
                of(ORDER, Integrator::ImplicitEuler)
            ),
            format!(
                "- `ExplicitEuler` and `SecondOrderTaylor` are for lessons: without damping the pendulum {} and {}.",
                of(ENERGY, Integrator::ExplicitEuler),
                of(ENERGY, Integrator::SecondOrderTaylor)
            ),
        ]
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
            let label = format!("`{name}`");
            let cells = columns.iter().map(|column| self.found(column, integrator));
            table.row([label.as_str()].into_iter().chain(cells).chain([purpose(&name)]));
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
        "ImplicitEuler" => "states of rest; what is to lose its energy",
        "TrBdf2" => "stiff nets, large ratios of masses",
        "Xpbd" => "short or soft nets on a fixed budget of time",
        "SecondOrderTaylor" => "free fall",
        "ExplicitEuler" => "watching it explode",
        _ => "",
    }
}
