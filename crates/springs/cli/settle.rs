//! `springs settle`: the equilibrium of a scene, and the path there.

use super::Ending;
use super::signals::Signals;
use super::statics::{StaticsArguments, Work, equilibrium_files, sentence_from};
use springs::inspect::short;
use springs::io::{PATH, PathReport, PathRow, SettleReport, write_path};
use springs::statics::{LoadPath, PathEnd, settle, trace};

#[derive(clap::Args)]
pub(crate) struct SettleArguments {
    #[command(flatten)]
    work: StaticsArguments,
    /// Follow the equilibrium as loads grow from nothing, past limit points, over at most N points: path.csv
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    path: Option<u32>,
}

pub(crate) fn settle_command(arguments: &SettleArguments) -> anyhow::Result<Ending> {
    let _signals = Signals::watch();
    let mut work = arguments.work.begin()?;
    let mut path = None;
    if let Some(most_points) = arguments.path {
        match trace(work.scene(), most_points as usize, &work.options) {
            Ok(traced) => path = Some(traced),
            Err(error) => return work.not_found(work.report(), &error),
        }
    }
    if let Some(path) = &path {
        if path.end != PathEnd::WholeLoad {
            return end_of_path(&work, path);
        }
        let last = path.points.last().expect("a path has a point");
        for (node, position) in work.source.scene.nodes.iter_mut().zip(&last.positions) {
            if !node.fixed {
                node.position = *position;
            }
        }
    }
    let report_path = path.as_ref().map(path_report);
    let equilibrium = match settle(work.scene(), &work.options) {
        Ok(equilibrium) => equilibrium,
        Err(error) => return work.not_found(work.report(), &error),
    };
    let folder = work.folder()?;
    work.write(&folder, &equilibrium)?;
    let mut written = equilibrium_files().to_vec();
    if let Some(path) = &path {
        write_path(&folder.path, &rows(path)).map_err(super::Unwritten::from)?;
        written.push(PATH);
    }
    folder.report(&SettleReport {
        path: report_path,
        ..work.report_of(&equilibrium)
    })?;
    folder.remove_others(&written);
    let start = match path {
        Some(_) => "at the end of the path",
        None => "as given",
    };
    work.say(&sentence_from(start, &equilibrium));
    if let Some(path) = &path {
        work.say(&limits(path));
    }
    let (into, files) = (folder.path.display(), written.join(", "));
    work.say(&format!("{files} written into {into}"));
    Ok(Ending::Done)
}

/// Where a path does not come to the whole load, there is no equilibrium on it.
fn end_of_path(work: &Work, path: &LoadPath) -> anyhow::Result<Ending> {
    let folder = work.folder()?;
    write_path(&folder.path, &rows(path)).map_err(super::Unwritten::from)?;
    let brief = path_report(path);
    let (factor, points) = (short(brief.load_factor), brief.points);
    let (reason, advice) = match path.end {
        PathEnd::Lost => (
            format!("the path could not be followed beyond load factor {factor}"),
            "hold what is free to move without resistance, such as motions out of a plane",
        ),
        _ => (
            format!("the path came to load factor {factor} in {points} points, not to 1"),
            "allow for more points with --path, or lessen the loads",
        ),
    };
    let report = SettleReport {
        path: Some(brief),
        ..work.report()
    };
    work.end_without(&folder, report, (&reason, Some(advice)), &[PATH])
}

fn rows(path: &LoadPath) -> Vec<PathRow> {
    let rows = path.points.iter().map(|point| PathRow {
        load_factor: point.factor,
        displacement: point.displacement,
        negative_pivots: point.negative_pivots,
        is_limit: point.is_limit,
    });
    rows.collect()
}

fn path_report(path: &LoadPath) -> PathReport {
    let limits = path.points.iter().filter(|point| point.is_limit);
    PathReport {
        end: match path.end {
            PathEnd::WholeLoad => "whole load",
            PathEnd::MostPoints => "most points",
            PathEnd::Lost => "lost",
        }
        .to_owned(),
        points: path.points.len(),
        load_factor: path.points.last().map_or(0.0, |point| point.factor),
        limit_load_factors: limits.map(|point| point.factor).collect(),
    }
}

/// What there is to say of limit points.
fn limits(path: &LoadPath) -> String {
    let limits = path_report(path).limit_load_factors;
    let limits: Vec<String> = limits.into_iter().map(short).collect();
    match limits.len() {
        0 => "the path has no limit point".to_owned(),
        _ => format!("limit points at load factors {}", limits.join(", ")),
    }
}
