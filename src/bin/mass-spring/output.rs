//! Where the results go: files or stdout, as CSV and JSON.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::Path;

use serde::Serialize;

use crate::Failure;
use crate::arguments::RunArguments;
use crate::simulation::ParticleState;

/// What `run` writes at its end, in this order.
#[derive(Debug, Serialize)]
pub struct Summary {
    pub particles: usize,
    pub springs: usize,
    pub ticks: u64,
    pub time: f64,
    pub integrator: String,
    pub substeps: u32,
    pub threads: usize,
    pub finite: bool,
    pub max_stretch: f64,
    pub mean_stretch: f64,
    pub kinetic_energy: f64,
    pub elastic_energy: f64,
    pub gravitational_energy: f64,
    pub momentum: [f64; 3],
    pub contacts: usize,
    pub milliseconds_per_tick: f32,
    pub milliseconds_per_step: f32,
    pub state_hash: String,
    pub nets: usize,
    /// Springs broken since the start.
    pub broken: usize,
    /// How deep a particle is inside a collider, its radius counted, m.
    pub max_depth: f64,
}

/// A file or stdout, opened for writing.
pub struct Sink {
    destination: String,
    writer: BufWriter<Box<dyn Write>>,
    closed: bool,
}

impl Sink {
    fn stdout() -> Self {
        Self::new("stdout".to_owned(), Box::new(io::stdout()))
    }

    fn new(destination: String, writer: Box<dyn Write>) -> Self {
        Self { destination, writer: BufWriter::new(writer), closed: false }
    }

    /// Whether the other end of the pipe is closed. What is written then is dropped.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    fn write(&mut self, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
        if self.closed {
            return Ok(());
        }
        match write(&mut self.writer) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => self.closed = true,
            Err(source) => {
                return Err(Failure::Unwritable { destination: self.destination.clone(), source });
            }
            Ok(()) => {}
        }
        Ok(())
    }

    /// Writes the header of the CSV.
    pub fn write_header(&mut self) -> Result<(), Failure> {
        self.write(|writer| writeln!(writer, "tick,time,particle,x,y,z,vx,vy,vz"))
    }

    /// Writes a row for each particle. `{:?}` prints the shortest digits that read back to the same number.
    pub fn write_rows(&mut self, tick: u64, time: f64, states: &[ParticleState]) -> Result<(), Failure> {
        self.write(|writer| {
            for (index, ParticleState { position, velocity }) in states.iter().enumerate() {
                write!(writer, "{tick},{time:?},{index}")?;
                for number in position.to_array().into_iter().chain(velocity.to_array()) {
                    write!(writer, ",{number:?}")?;
                }
                writeln!(writer)?;
            }
            Ok(())
        })
    }

    /// Writes the summary as a line of JSON.
    pub fn write_summary(&mut self, summary: &Summary) -> Result<(), Failure> {
        self.write(|writer| {
            serde_json::to_writer(&mut *writer, summary)?;
            writeln!(writer)
        })
    }

    /// Flushes the file.
    pub fn finish(mut self) -> Result<(), Failure> {
        self.write(|writer| writer.flush())
    }
}

/// Prints `text` to stdout.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = Sink::stdout();
    stdout.write(|writer| writer.write_all(text.as_bytes()))?;
    stdout.finish()
}

/// Where a run writes to.
pub struct Sinks {
    pub csv: Option<Sink>,
    pub json: Option<Sink>,
}

impl Sinks {
    /// Opens the outputs that the arguments name.
    ///
    /// If one of them cannot be opened, the others are left as they were.
    pub fn open(arguments: &RunArguments) -> Result<Self, Failure> {
        let stdout = Path::new("-");
        let csv = arguments.csv.as_deref();
        let json = match arguments.json.as_deref() {
            None if csv != Some(stdout) => Some(stdout),
            json => json,
        };
        if csv == Some(stdout) && json == Some(stdout) {
            return Err(Failure::Refused("--csv and --json cannot both go to stdout".to_owned()));
        }
        let mut files: Vec<Candidate> = Vec::new();
        for path in [csv, json].into_iter().flatten().filter(|path| *path != stdout) {
            match Candidate::open(path, &arguments.scene, &files) {
                Ok(file) => files.push(file),
                Err(failure) => {
                    files.into_iter().for_each(Candidate::abandon);
                    return Err(failure);
                }
            }
        }
        let mut files = files.into_iter();
        let mut sink = |path: &Path| {
            if path == stdout {
                return Ok(Sink::stdout());
            }
            files.next().expect("one candidate was opened for each file").into_sink()
        };
        Ok(Self { csv: csv.map(&mut sink).transpose()?, json: json.map(&mut sink).transpose()? })
    }
}

/// A file that was opened, but not changed yet.
struct Candidate<'path> {
    path: &'path Path,
    file: File,
    created: bool,
}

impl<'path> Candidate<'path> {
    fn open(path: &'path Path, scene: &Path, others: &[Candidate]) -> Result<Self, Failure> {
        let is = |other: &Path| {
            let same =
                matches!((path.canonicalize(), other.canonicalize()), (Ok(one), Ok(two)) if one == two);
            same && path.is_file()
        };
        let shown = path.display();
        if is(scene) {
            return Err(Failure::Refused(format!("{shown} is the scene, it would be overwritten")));
        }
        if others.iter().any(|other| is(other.path)) {
            return Err(Failure::Refused(format!("--csv and --json cannot both go to {shown}")));
        }
        let created = !path.exists();
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(|error| Failure::Refused(format!("cannot write {shown}: {error}")))?;
        Ok(Self { path, file, created })
    }

    fn abandon(self) {
        if self.created {
            // Nothing more can be done about an empty file that cannot be removed.
            let _ = fs::remove_file(self.path);
        }
    }

    fn into_sink(self) -> Result<Sink, Failure> {
        let destination = self.path.display().to_string();
        // Devices and pipes have no length to cut.
        let emptied = match self.file.metadata() {
            Ok(metadata) if metadata.is_file() => self.file.set_len(0),
            Ok(_) => Ok(()),
            Err(error) => Err(error),
        };
        match emptied {
            Ok(()) => Ok(Sink::new(destination, Box::new(self.file))),
            Err(source) => Err(Failure::Unwritable { destination, source }),
        }
    }
}
