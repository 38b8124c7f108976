//! `springs plot`: pictures of the tables of a run.

mod common;

use common::workspace::Workspace;

/// Points of the paths of a picture that have this colour.
fn points(picture: &str, colour: &str) -> usize {
    let stroke = format!("stroke=\"{colour}\" stroke-width=\"1.5\"");
    let paths = picture.lines().filter(|line| line.contains(&stroke));
    paths.map(|path| path.matches(['M', 'L']).count()).sum()
}

#[test]
fn the_tables_of_a_run_are_drawn() {
    let workspace = Workspace::new();
    workspace.scene("cloth.ron", "cloth 4 --duration 0.5 --tolerance 1e-3");
    workspace.expect(
        0,
        "run cloth.ron --frames 20 --write energy,steps,springs --out o --quiet",
    );
    let said = workspace.expect(0, "plot o");
    assert!(
        said.contains("wrote energy.svg, steps.svg, peaks.svg into o"),
        "{said}"
    );
    let energies = workspace.read("o/energy.svg");
    // Kinetic energies are the first curve, of 21 frames, and loads did nothing.
    let first_chart = &energies[..energies.find("since the start").unwrap()];
    assert_eq!(points(first_chart, "#000000"), 21);
    assert!(energies.contains(">gain of the method<") && !energies.contains("work of loads"));
    let steps = workspace.read("o/steps.svg");
    assert!(steps.contains(">allowed error<") && steps.contains(">cloth 4: step sizes,"));
    let springs = workspace.report("o")["springs"].as_u64().unwrap() as usize;
    let dots = workspace.read("o/peaks.svg").matches("<circle").count();
    // Two in the legend.
    assert_eq!(dots, 2 * springs + 2);
    // Another run removes them with the rest.
    workspace.expect(0, "run cloth.ron --out o --force --quiet");
    assert_eq!(workspace.names("o"), ["final.ron", "report.json"]);
}

/// The scene at the end has its loads where they are then; the picture has them as they were.
#[test]
fn the_filmstrip_has_the_loads_of_its_panels() {
    let workspace = Workspace::new();
    let scene = "Scene(version: 1,
        nodes: [(position: (0, 0, 0), fixed: true), (position: (0, 0, -1), mass: 1)],
        springs: [(nodes: (0, 1), stiffness: 100)],
        loads: [(nodes: [1], force: (0, 0, -8), over_time: Ramp(from: 0, to: 4))],
        simulation: (method: VelocityVerlet, step: 0.01, duration: 1))";
    std::fs::write(workspace.path("one.ron"), scene).unwrap();
    workspace.expect(0, "run one.ron --write svg --out o --quiet");
    let picture = workspace.read("o/filmstrip.svg");
    assert!(picture.contains(">load, 2 N at most<"), "{picture}");
}

#[test]
fn probes_of_one_unit_share_a_chart() {
    let workspace = Workspace::new();
    let table = "time,item,index,quantity,value\n0.0,node,1,x,1.0\n0.0,node,1,z,2.0\n\
                 0.0,spring,3,tension,5.0\n0.5,node,1,x,1.5\n0.5,node,1,z,2.5\n";
    std::fs::write(workspace.path("probes.csv"), table).unwrap();
    workspace.expect(0, "plot .");
    let picture = workspace.read("probes.svg");
    for text in [
        ">position (m)<",
        ">node 1, x<",
        ">node 1, z<",
        ">tension (N)<",
        ">spring 3<",
    ] {
        assert_eq!(picture.matches(text).count(), 1, "{text}");
    }
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let workspace = Workspace::new();
    let said = workspace.expect(2, "plot .");
    assert!(
        said.contains("the folder `.` holds no table to draw"),
        "{said}"
    );
    assert!(said.contains("--write energy,steps,springs"), "{said}");
    std::fs::write(workspace.path("peaks.csv"), "spring,max_tension\n").unwrap();
    let said = workspace.expect(2, "plot .");
    assert!(
        said.contains("peaks.csv:1: the table has no column `min_tension`"),
        "{said}"
    );
    std::fs::write(
        workspace.path("peaks.csv"),
        "spring,max_tension,min_tension\n0,1,2\n1,x,2\n",
    )
    .unwrap();
    let said = workspace.expect(2, "plot .");
    assert!(
        said.contains("peaks.csv:3: there is no number in the column `max_tension`"),
        "{said}"
    );
}
