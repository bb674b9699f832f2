//! A closed loop as a run advances it (`simulated_loop`) or as its caller does (`stepped_loop`), and the receiver of its records (`sink`).
//! `log` stores the records that programs compute.

pub mod log;
pub mod simulated_loop;
pub mod sink;
pub mod stepped_loop;
