//! The farm over real connections: a coordinator on a free port, workers of the library, and workers that misbehave.

mod attack;
mod audits;
mod browser;
mod calls;
mod chaos;
mod devices;
mod harness;
mod hostile;
mod limits;
mod resumed;
mod revisions;
mod security;
mod series;
mod stopping;
mod submissions;
mod tev;
mod view;
mod watching;
mod workers;
