//! Tests that the headers compile without a warning in C and C++: alone, and included twice.

use std::fs;
use std::process::Command;

use crate::library::declared;
use crate::toolchain::{STRICT, compiler, is_installed, root, run_well};

/// A program that uses every macro, so that the compiler checks each of them.
const EVERY_INIT: &str = "
#include \"dcd.h\"
#include \"dcd.h\"
int main(void)
{
    DcdWorldDef world_def = DCD_WORLD_DEF_INIT;
    DcdBodyDef body_def = DCD_BODY_DEF_INIT;
    DcdCharacterDef character_def = DCD_CHARACTER_DEF_INIT;
    DcdWheel wheel = DCD_WHEEL_INIT;
    DcdVehicleDef vehicle_def = DCD_VEHICLE_DEF_INIT;
    DcdCharacterState character_state = DCD_CHARACTER_STATE_INIT;
    DcdJointDef joint_def = DCD_JOINT_DEF_INIT;
    DcdBodyProperties body_properties = DCD_BODY_PROPERTIES_INIT;
    DcdColliderProperties collider_properties = DCD_COLLIDER_PROPERTIES_INIT;
    DcdFilter filter = DCD_FILTER_INIT;
    DcdRay ray = DCD_RAY_INIT;
    DcdShapeCast shape_cast = DCD_SHAPE_CAST_INIT;
    DcdPointQuery point_query = DCD_POINT_QUERY_INIT;
    DcdShapeQuery shape_query = DCD_SHAPE_QUERY_INIT;
    DcdBoxQuery box_query = DCD_BOX_QUERY_INIT;
    DcdJointMotor joint_motor = DCD_JOINT_MOTOR_INIT;
    DcdJointInfo joint_info = DCD_JOINT_INFO_INIT;
    DcdWorldInfo world_info = DCD_WORLD_INFO_INIT;
    DcdBodyInfo body_info = DCD_BODY_INFO_INIT;
    DcdShapeInfo shape_info = DCD_SHAPE_INFO_INIT;
    DcdSettings settings = DCD_SETTINGS_INIT;
    DcdProfile profile = DCD_PROFILE_INIT;
    DcdExplosion explosion = DCD_EXPLOSION_INIT;
    DcdFluid fluid = DCD_FLUID_INIT;
    DcdHooks hooks = DCD_HOOKS_INIT;
    DcdTasks tasks = DCD_TASKS_INIT;
    DcdBodyExtent body_extent = DCD_BODY_EXTENT_INIT;
    DcdStateView state_view = DCD_STATE_VIEW_INIT;
    DcdViewTime view_time = DCD_VIEW_TIME_INIT;
    DcdDebugDraw debug_draw = DCD_DEBUG_DRAW_INIT;
    DcdEventView event_view = DCD_EVENT_VIEW_INIT;
    DcdOwner owner = DCD_OWNER_INIT;
    DcdStats stats = DCD_STATS_INIT;
    DcdClientDef client_def = DCD_CLIENT_DEF_INIT;
    DcdParticipantDef participant_def = DCD_PARTICIPANT_DEF_INIT;
    return world_def.struct_size + body_def.struct_size + joint_def.struct_size + joint_motor.model + filter.struct_size + ray.flags +
                   shape_cast.flags + point_query.flags + shape_query.reserved + box_query.reserved + body_properties.struct_size +
                   collider_properties.struct_size + joint_info.struct_size + world_info.struct_size +
                   body_info.struct_size + owner.struct_size + state_view.struct_size + view_time.struct_size + debug_draw.struct_size + event_view.struct_size + stats.struct_size +
                   client_def.struct_size + participant_def.struct_size + character_def.struct_size +
                   vehicle_def.struct_size + character_state.struct_size + hooks.struct_size + tasks.struct_size + profile.struct_size + explosion.struct_size + fluid.struct_size + settings.struct_size + shape_info.struct_size + body_extent.struct_size + (wheel.radius < 0.0f) ==
               0
           ? DCD_VERSION
           : DCD_OK;
}
";

fn compiles(variable: &str, default: &str, name: &str, source: &str, flags: &[&str]) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    fs::write(&path, source).unwrap();
    let mut command = compiler(variable, default);
    run_well(command.args(STRICT).args(flags).arg("-fsyntax-only").arg(&path));
}

#[test]
fn the_header_compiles_alone_and_twice_as_c() {
    for dialect in ["-std=c11", "-std=c17"] {
        let flags = [dialect, "-Wstrict-prototypes"];
        compiles("CC", "cc", "alone.c", "#include \"dcd.h\"\n", &flags);
        compiles("CC", "cc", "twice.c", EVERY_INIT, &flags);
    }
}

#[test]
fn the_header_compiles_alone_and_twice_as_cpp() {
    compiles("CXX", "c++", "alone.cpp", "#include \"dcd.h\"\n", &["-std=c++17"]);
    compiles("CXX", "c++", "twice.cpp", EVERY_INIT, &["-std=c++17"]);
}

#[test]
fn the_cpp_header_compiles_alone_and_twice_with_and_without_exceptions() {
    for dialect in ["-std=c++17", "-std=c++20"] {
        for flag in ["-fno-exceptions", "-DDCD_EXCEPTIONS"] {
            let source = "#include \"dcd.hpp\"\n";
            compiles("CXX", "c++", "alone.cpp", source, &[dialect, flag]);
            compiles("CXX", "c++", "twice.cpp", &source.repeat(2), &[dialect, flag]);
        }
    }
}

#[test]
fn the_cpp_header_has_every_function_of_the_c_header() {
    let wrapper = fs::read_to_string(root().join("include/dcd.hpp")).unwrap();
    for function in declared() {
        // The function is called, or passed to what calls it.
        let is_there = ["(", ")"].iter().any(|end| wrapper.contains(&format!("{function}{end}")));
        assert!(is_there, "{function} is missing in dcd.hpp");
    }
}

#[test]
fn the_manual_builds_without_a_warning() {
    if !is_installed("doxygen") {
        eprintln!("doxygen is not installed: nothing checked");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let mut settings = fs::read_to_string(root().join("dcd-ffi/Doxyfile")).unwrap();
    settings += &format!("OUTPUT_DIRECTORY = {}\n", dir.path().display());
    fs::write(dir.path().join("Doxyfile"), settings).unwrap();
    run_well(Command::new("doxygen").arg(dir.path().join("Doxyfile")).current_dir(root()));
    let manual = fs::read_to_string(dir.path().join("html/dcd_8h.html")).unwrap();
    for function in declared() {
        assert!(manual.contains(&format!(">{function}()</h2>")), "{function} is missing in the manual");
    }
}
