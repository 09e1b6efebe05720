//! Formats a report as a table for people.

use crate::runtime::measure::{Chosen, Report};

pub(super) fn of(report: &Report) -> String {
    let Report { scene, bodies, ticks, wall_s, rtf, .. } = report;
    let simulated_s = *ticks as f64 * f64::from(report.dt_s);
    let made_of = match (report.regions, report.coupling) {
        (0, _) | (_, None) => "one bare Rapier world".to_owned(),
        (1, _) => "1 region".to_owned(),
        (regions, Some(coupling)) => format!(
            "{regions} regions on {} threads, coupling `{coupling}`, exchanges {}",
            report.threads, report.exchanges
        ),
    };
    let ms = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
    let step = &report.step_ms;
    let rows = [
        (
            "step",
            format!(
                "{} ms mean, {} median, {} at 99 %, {} longest (from the 31st)",
                ms(step.mean),
                ms(step.p50),
                ms(step.p99),
                ms(step.max)
            ),
        ),
        ("contacts", report.contacts.to_string()),
        ("ghosts", format!("{:.1} mean", report.ghosts_mean)),
        ("transfers", report.transfers.to_string()),
        (
            "energy",
            format!("{:.6} J at the start, {:.6} J at the end", report.energy_j.start, report.energy_j.end),
        ),
        (
            "momentum",
            format!(
                "{} kg m/s at the start, {} at the end",
                vector(report.momentum_kgms.start),
                vector(report.momentum_kgms.end)
            ),
        ),
        ("penetration", format!("{:.6} m at most in the last second", report.max_penetration_m)),
        (
            "ground force",
            match report.ground_force_ratio {
                Some(ratio) => format!("{ratio:.6} of the weight in the last second"),
                None => "none: nothing has weight".to_owned(),
            },
        ),
        (
            "exchanges",
            format!(
                "{:.2} a tick; copies disagree by {:.6} m/s mean, {:.6} m/s at most",
                report.exchanges_mean, report.disagreement_m_s.mean, report.disagreement_m_s.max
            ),
        ),
        (
            "busiest",
            format!(
                "{:.2} times the mean of all regions, {:.2} at most",
                report.imbalance.mean, report.imbalance.max
            ),
        ),
        ("lost", report.lost.to_string()),
        ("doubled", report.doubled.to_string()),
        ("quarantined", report.quarantined.to_string()),
        ("state", report.state_hash.clone()),
        ("chosen", chosen(&report.chosen)),
    ];
    let mut lines = vec![
        format!("{scene}: {bodies} bodies, {made_of}"),
        format!("{ticks} ticks ({simulated_s:.2} s) in {wall_s:.3} s: {rtf:.2} times real time"),
        String::new(),
    ];
    let fidelity = report.fidelity.as_ref().map(|fidelity| ("fidelity", fidelity.words()));
    lines.extend(rows.into_iter().chain(fidelity).map(|(name, value)| format!("{name:<14}{value}")));
    lines.join("\n")
}

fn chosen(chosen: &Chosen) -> String {
    let Chosen { regions, threads, why, .. } = chosen;
    let made_of = match regions {
        0 => "a bare Rapier world".to_owned(),
        1 => "1 region".to_owned(),
        regions => format!("{regions} regions"),
    };
    let threads = if *threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
    format!("{made_of} on {threads}: {why}")
}

fn vector(v: [f64; 3]) -> String {
    format!("({:.4}, {:.4}, {:.4})", v[0], v[1], v[2])
}
