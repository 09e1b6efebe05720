//! Tests that broken and malicious files are refused by name: none ends the process, hangs it or is read in
//! part.

use std::fs;

use dcd::scene::{Params, Scene, SceneError};

/// The files of one folder.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        files.iter().for_each(|(name, text)| folder.write(name, text));
        folder
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.0.path().join(name), text).unwrap();
    }

    /// Loads a file that may name any other file.
    fn load(&self, name: &str) -> Result<Scene, SceneError> {
        self.load_with(name, &Params::new().with("outside", 1))
    }

    fn load_with(&self, name: &str, params: &Params) -> Result<Scene, SceneError> {
        Scene::load(self.0.path().join(name), params)
    }

    /// Returns the error of a file that must be refused.
    fn error(&self, name: &str) -> String {
        self.load(name).map(|scene| scene.bodies.len()).unwrap_err().to_string()
    }
}

#[test]
fn files_that_nest_or_include_without_end_and_files_that_are_none_are_refused() {
    let folder = Folder::new(&[]);
    let refused = |name: &str, text: String| {
        folder.write(name, &text);
        folder.error(name)
    };
    for levels in [300, 3_000, 300_000] {
        let nested = |tag: &str| format!("<{tag}>").repeat(levels) + &format!("</{tag}>").repeat(levels);
        let model = format!("<mujoco>\n<worldbody>\n{}</worldbody></mujoco>", nested("body"));
        let error = refused("deep.xml", model);
        assert!(error.contains("deep.xml:3: more than 256 elements lie in one another"), "{error}");
        let error = refused("deep.urdf", format!("<robot>{}</robot>", nested("link")));
        assert!(error.contains("deep.urdf:1: more than 256 elements"), "{error}");
    }
    let robot = |file: &str| {
        format!(
            "<mujoco><worldbody><include file=\"{file}\"/><include file=\"{file}\"/></worldbody></mujoco>"
        )
    };
    let error = refused("endless.xml", robot("/dev/zero"));
    assert!(error.contains("/dev/zero: it is not a regular file"), "{error}");
    // Each file includes the next one twice: thirty files of a hundred bytes are 2^30 geoms.
    for level in 0..30 {
        let inner = robot(&format!("{}.xml", level + 1));
        folder.write(&format!("{level}.xml"), &inner);
    }
    for (geoms, cause) in [(0, "more than 4096 files are included"), (3_000, "have more than 16 MiB")] {
        let last = format!("<mujoco>{}</mujoco>", "<geom size=\"1\"/>".repeat(geoms));
        folder.write("30.xml", &last);
        let error = folder.error("0.xml");
        assert!(error.contains(cause) && error.contains("include less"), "{error}");
    }
}

#[test]
fn what_cannot_be_included_is_refused_by_name_and_what_is_in_an_include_gives_way() {
    let main = |include: &str| format!("<mujoco>\n<worldbody>\n{include}\n</worldbody></mujoco>");
    let folder = Folder::new(&[
        ("both.xml", &main(r#"<include file="body.xml"><include file="none.xml"/></include>"#)),
        ("body.xml", r#"<mujoco><body><freejoint/><geom size="1"/></body></mujoco>"#),
        ("rootless.xml", &main(r#"<include file="other.xml"/>"#)),
        ("rooted_twice.xml", &main(r#"<include file="other_twice.xml"/>"#)),
        ("other.xml", r#"<include file="empty.xml"/>"#),
        ("other_twice.xml", r#"<include file="twice.xml"/>"#),
        ("empty.xml", "<mujoco/>"),
        ("twice.xml", "<mujoco><body/><body/></mujoco>"),
        ("spaced.xml", &main(r#"<include file="through.xml"/>"#)),
        ("through.xml", r#"<mujoco><include file="space.xml"/></mujoco>"#),
        ("space.xml", r#"<mujoco xmlns:x="u"><x:body/></mujoco>"#),
        ("late.xml", &main("<include file=\"body.xml\"/>\n<replicate/>")),
    ]);
    assert_eq!(folder.load("both.xml").unwrap().bodies.len(), 1);
    for (name, cause) in [
        ("rootless.xml", "rootless.xml:3: other.xml cannot be put here"),
        ("rooted_twice.xml", "rooted_twice.xml:3: other_twice.xml cannot be put here"),
        ("spaced.xml", "through.xml:1: space.xml cannot be put here"),
        // Its line numbers are not those of the text with all its includes.
        ("late.xml", "late.xml: <replicate> in a body"),
    ] {
        let error = folder.error(name);
        assert!(error.contains(cause), "{name}: {error}");
    }
}

#[test]
fn models_that_attach_themselves_or_what_is_not_there_are_refused() {
    let attaching = |file: &str, body: &str| {
        format!(
            r#"<mujoco><asset><model name="m" file="{file}"/></asset><worldbody><body name="b">
            <attach model="m" body="{body}" prefix="p"/></body></worldbody></mujoco>"#
        )
    };
    let arm =
        |inside: &str| format!(r#"<mujoco><worldbody><body name="arm">{inside}</body></worldbody></mujoco>"#);
    let folder = Folder::new(&[
        ("itself.xml", &attaching("itself.xml", "b")),
        ("each.xml", &attaching("other.xml", "b")),
        ("other.xml", &attaching("each.xml", "b")),
        ("endless.xml", &attaching("/dev/zero", "b")),
        ("missing.xml", &attaching("none.xml", "b")),
        ("arm.xml", &arm("")),
        ("misspelt.xml", &attaching("arm.xml", "amr")),
        ("unknown.xml", &attaching("arm.xml", "arm").replace(r#"model="m""#, r#"model="n""#)),
        ("whole.xml", &attaching("arm.xml", "arm").replace(r#"body="arm""#, "")),
        ("broken_arm.xml", &arm(r#"<geom size="x"/>"#)),
        ("broken.xml", &attaching("broken_arm.xml", "arm")),
        ("many_arms.xml", &arm(r#"<replicate count="3"><geom size="1"/></replicate>"#)),
        ("many.xml", &attaching("many_arms.xml", "arm")),
        ("including_arm.xml", &arm(r#"<include file="/dev/zero"/>"#)),
        ("including.xml", &attaching("including_arm.xml", "arm")),
        ("turned_arm.xml", &arm("").replace("<worldbody>", r#"<compiler eulerseq="xyzx"/><worldbody>"#)),
        ("turned.xml", &attaching("turned_arm.xml", "arm")),
    ]);
    for (name, cause) in [
        ("itself.xml", "itself.xml:1: itself.xml attaches itself"),
        ("each.xml", "other.xml:1: each.xml attaches itself"),
        ("endless.xml", "/dev/zero: it is not a regular file"),
        ("missing.xml", "none.xml: No such file"),
        ("misspelt.xml", "misspelt.xml:2: <attach> of body `amr`, which model `m` does not have"),
        ("unknown.xml", "unknown.xml:2: <attach> of model `n`, which <asset> does not have"),
        ("whole.xml", "whole.xml:2: <attach> without body"),
        ("broken.xml", "broken_arm.xml"),
        ("many.xml", "many_arms.xml:1: <replicate> in a body"),
        ("including.xml", "including_arm.xml:1: <include> in a model that is attached"),
        ("turned.xml", "turned_arm.xml:1: eulerseq=\"xyzx\" is not three axes"),
    ] {
        let error = folder.error(name);
        assert!(error.contains(cause), "{name}: {error}");
    }
    // Each file attaches the next one twice: thirty files of two hundred bytes are 2^30 bodies.
    for level in 0..30 {
        let twice = attaching(&format!("{}.xml", level + 1), "b");
        let twice = twice.replace("</body>", "<attach model=\"m\" body=\"b\" prefix=\"q\"/></body>");
        folder.write(&format!("{level}.xml"), &twice);
    }
    folder.write("30.xml", &arm("").replace("arm", "b"));
    let error = folder.error("0.xml");
    assert!(error.contains("what it attaches have more than 16 MiB; attach less"), "{error}");
}

#[test]
fn a_model_opens_no_file_outside_of_its_folder_unless_it_is_allowed_to() {
    let tetra = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let body = r#"<mujoco><worldbody><body name="b"><geom size="1"/></body></worldbody></mujoco>"#;
    let mjcf = |inside: &str| format!("<mujoco>\n{inside}</mujoco>");
    let including = |file: &str| mjcf(&format!(r#"<include file="{file}"/>"#));
    let attaching = |file: &str| {
        mjcf(&format!(
            r#"<asset><model name="m" file="{file}"/></asset><worldbody><body><attach model="m" body="b"/></body></worldbody>"#
        ))
    };
    let meshed = |file: &str| {
        mjcf(&format!(
            r#"<asset><mesh name="m" file="{file}"/></asset><worldbody><body><geom type="mesh" mesh="m"/></body></worldbody>"#
        ))
    };
    let robot = |mesh: &str| {
        format!(
            r#"<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
            <collision><geometry><mesh filename="{mesh}"/></geometry></collision></link></robot>"#
        )
    };
    let folder = Folder::new(&[("body.xml", body), ("tetra.obj", tetra)]);
    fs::create_dir_all(folder.0.path().join("robot/meshes")).unwrap();
    fs::create_dir_all(folder.0.path().join("package/meshes")).unwrap();
    let whole = |name: &str| folder.0.path().join(name).display().to_string();
    let name = folder.0.path().file_name().unwrap().to_str().unwrap();
    for (at, text) in [
        ("robot/includes.xml", including("../body.xml")),
        ("robot/includes_whole.xml", including(&whole("body.xml"))),
        ("robot/inner.xml", including("../body.xml")),
        ("robot/includes_one_that_includes.xml", including("inner.xml")),
        ("robot/attaches.xml", attaching("../body.xml")),
        ("robot/loads.xml", meshed("../tetra.obj")),
        ("robot/loads.urdf", robot("../tetra.obj")),
        ("robot/loads_whole.urdf", robot(&format!("file://{}", whole("tetra.obj")))),
        ("robot/loads_above.urdf", robot("package://any/tetra.obj")),
        ("robot/loads_by_name.urdf", robot(&format!("package://{name}/tetra.obj"))),
        ("robot/loads_root.urdf", robot(&format!("package://{}", whole("tetra.obj")))),
    ] {
        folder.write(at, &text);
        let error =
            folder.load_with(at, &Params::new()).map(|scene| scene.bodies.len()).unwrap_err().to_string();
        let remedy = "put it there, or allow the model all files: `outside=1`";
        assert!(error.contains(" lies outside of ") && error.contains(remedy), "{at}: {error}");
        assert_eq!(
            folder.load(at).unwrap().bodies.len(),
            if at.contains("attaches") { 2 } else { 1 },
            "{at}"
        );
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(whole("tetra.obj"), folder.0.path().join("robot/link.obj")).unwrap();
        folder.write("robot/loads_link.urdf", &robot("link.obj"));
        let error =
            folder.load_with("robot/loads_link.urdf", &Params::new()).map(drop).unwrap_err().to_string();
        assert!(error.contains(" lies outside of "), "{error}");
    }
    // Files in the model's own folder, in its ROS package, or in another package.
    folder.write("robot/meshes/tetra.obj", tetra);
    folder.write("robot/own.urdf", &robot("package://robot/meshes/tetra.obj"));
    folder.write("package/package.xml", "<package/>");
    folder.write("package/meshes/tetra.obj", tetra);
    folder.write("robot/other.urdf", &robot("package://package/meshes/tetra.obj"));
    fs::create_dir_all(folder.0.path().join("package/urdf")).unwrap();
    folder.write("package/urdf/beside.urdf", &robot("../meshes/tetra.obj"));
    for at in ["robot/own.urdf", "robot/other.urdf", "package/urdf/beside.urdf"] {
        assert_eq!(folder.load_with(at, &Params::new()).unwrap().bodies.len(), 1, "{at}");
    }
}

#[test]
fn what_an_obj_says_of_colours_is_not_read() {
    let tetra = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let robot = |mesh: &str| {
        format!(
            r#"<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
            <collision><geometry><mesh filename="{mesh}"/></geometry></collision></link></robot>"#
        )
    };
    let folder = Folder::new(&[
        ("endless.urdf", &robot("endless.obj")),
        ("endless.obj", &format!("mtllib /dev/zero\n{tetra}")),
        ("broken.urdf", &robot("broken.obj")),
        ("broken.obj", &format!("mtllib broken.mtl\n{tetra}")),
        ("broken.mtl", "newmtl a\nKd x\n"),
        ("flat.urdf", &robot("flat.obj")),
        ("flat.obj", &tetra.replace("v 1 0 0", "v nan 0 0")),
    ]);
    for name in ["endless.urdf", "broken.urdf"] {
        assert_eq!(folder.load(name).unwrap().bodies[0].colliders.len(), 1, "{name}");
    }
    let error = folder.error("flat.urdf");
    assert!(error.contains("flat.obj: a vertex of it is not finite"), "{error}");
}

#[test]
fn a_file_of_a_step_that_nothing_can_be_computed_by_is_refused() {
    let folder = Folder::new(&[]);
    for (option, cause) in [
        ("timestep=\"0\"", "step.xml: dt = 0 is out of range"),
        ("timestep=\"-0.01\"", "step.xml: dt = -0.01 is out of range"),
        ("gravity=\"0 0 -1e39\"", "step.xml: gravity"),
    ] {
        let text = format!("<mujoco><option {option}/><worldbody><geom size=\"1\"/></worldbody></mujoco>");
        folder.write("step.xml", &text);
        let error = folder.error("step.xml");
        assert!(error.contains(cause), "{option}: {error}");
    }
}

#[test]
fn a_model_of_more_bodies_or_pairs_than_are_of_use_is_refused() {
    let folder = Folder::new(&[]);
    let world = |bodies: &str| format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>");
    folder.write("many.xml", &world(&"<body/>".repeat(30_000)));
    let error = folder.error("many.xml");
    assert!(error.contains("many.xml: the model has 30001 bodies"), "{error}");
    let parts = "<body><geom size=\"1\"/></body>".repeat(1_000);
    folder.write("welded.xml", &world(&format!("<body><freejoint/><geom size=\"1\"/>{parts}</body>")));
    let error = folder.error("welded.xml");
    assert!(error.contains("welded.xml: more than 100000 pairs of bodies"), "{error}");
    let links: String = (0..30_000).map(|link| format!("<link name=\"{link}\"/>")).collect();
    folder.write("many.urdf", &format!("<robot>{links}</robot>"));
    let error = folder.error("many.urdf");
    assert!(error.contains("more than 20000 links"), "{error}");
}
