//! The conformance lab: what each scheme of the crate gets right, measured against converged f64
//! references.
//!
//! ```sh
//! cargo run --release --features conformance --example conformance            # writes docs/conformance.md
//! cargo run --release --features conformance --example conformance -- sweep   # prints one section
//! ```
//!
//! It works on the pure solver, on one thread.

mod backward_euler;
mod chains;
mod cost;
mod document;
mod energy_drift;
mod findings;
mod heavy_chain;
mod lattice;
mod machine;
mod mixed_stiffness;
mod net;
mod orders;
mod plot;
mod reference;
mod second_order;
mod second_order_f64;
mod sheet;
mod simulation;
mod stiff_contacts;
mod stiff_energy;
mod strands;
mod sweep;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use document::{Section, number};
use findings::Findings;
use plot::Plot;

/// What experiments share.
pub struct Lab {
    pictures: PathBuf,
    findings: Findings,
}

impl Lab {
    /// Draws `plot` and shows it in `section`.
    fn show(&self, section: &mut Section, file: &str, plot: &Plot) -> Result<(), Box<dyn Error>> {
        plot.write(&self.pictures.join(file))?;
        section.picture(&plot.title, file);
        Ok(())
    }
}

type Experiment = fn(&mut Lab) -> Result<Section, Box<dyn Error>>;

const EXPERIMENTS: [(&str, Experiment); 12] = [
    ("orders", orders::run),
    ("energy", energy_drift::run),
    ("stiff-energy", stiff_energy::run),
    ("second-order", second_order::run),
    ("stiff-contacts", stiff_contacts::run),
    ("mixed-stiffness", mixed_stiffness::run),
    ("sweep", sweep::run),
    ("chain", chains::run),
    ("heavy-chain", heavy_chain::run),
    ("strands", strands::run),
    ("sheet", sheet::run),
    ("cost", cost::run),
];

fn main() -> Result<(), Box<dyn Error>> {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let known = |name: &String| EXPERIMENTS.iter().any(|(known, _)| known == name);
    if let Some(unknown) = wanted.iter().find(|name| !known(name)) {
        let names = EXPERIMENTS.map(|(name, _)| name).join(", ");
        return Err(format!("no experiment is called {unknown:?}, expected some of {names}").into());
    }
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let pictures = docs.join("images/conformance");
    std::fs::create_dir_all(&pictures)?;
    let mut lab = Lab { pictures, findings: Findings::default() };
    let start = Instant::now();
    let mut sections = String::new();
    for (name, experiment) in EXPERIMENTS {
        if !wanted.is_empty() && !wanted.iter().any(|wanted| wanted == name) {
            continue;
        }
        eprint!("{name} …");
        let begin = Instant::now();
        sections.push_str(&experiment(&mut lab)?.text);
        eprintln!(" {:.1} s", begin.elapsed().as_secs_f64());
    }
    if wanted.is_empty() {
        let text = introduction(&lab, start.elapsed().as_secs_f64()) + &sections;
        std::fs::write(docs.join("conformance.md"), text.trim_end().to_owned() + "\n")?;
        eprintln!("written: docs/conformance.md");
    } else {
        print!("{sections}");
    }
    Ok(())
}

fn introduction(lab: &Lab, seconds: f64) -> String {
    let mut section = Section { text: "# Conformance lab\n\n".to_owned() };
    section.paragraph(
        "What each scheme of this crate gets right and what it costs, against references that this program \
         computes itself in f64 with code of its own. Everything below, numbers and pictures, was written by",
    );
    section.text.push_str("```sh\ncargo run --release --features conformance --example conformance\n```\n\n");
    section.paragraph(&format!(
        "on {}, on one core of: {}; it took {} s. Milliseconds are those of the \
         pure solver, without Bevy's world, and medians over the ticks of a run where nothing else is said; \
         other work on the machine shows in them. All other numbers are the same on every run of a build, but \
         for runs that are cut short.",
        machine::date(),
        machine::processor(),
        number(seconds.round())
    ));
    section.text.push_str("## Which scheme, when\n\n");
    section.table(lab.findings.table());
    section.list(&lab.findings.advice());
    section.paragraph("The table sums up the sections below, which say what was measured and how.");
    section.text
}
