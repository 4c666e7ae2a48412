//! The command line, run as a process: what it writes, what it refuses, and with which exit status.

mod field_cases;
mod motion;
mod nets;
mod output;
mod refusals;
mod workplace;
