//! `include/dcd.h` compiles by itself, twice in a row, in C and C++, without a warning.

use std::fs;

use crate::toolchain::compiler;

const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-pedantic", "-Werror"];

/// Uses every macro, so that none is only a comment.
const EVERY_INIT: &str = "
#include \"dcd.h\"
#include \"dcd.h\"
int main(void)
{
    DcdWorldDef world_def = DCD_WORLD_DEF_INIT;
    DcdBodyDef body_def = DCD_BODY_DEF_INIT;
    DcdJointDef joint_def = DCD_JOINT_DEF_INIT;
    DcdBodyProperties body_properties = DCD_BODY_PROPERTIES_INIT;
    DcdPartProperties part_properties = DCD_PART_PROPERTIES_INIT;
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
    DcdStateView state_view = DCD_STATE_VIEW_INIT;
    DcdEventView event_view = DCD_EVENT_VIEW_INIT;
    DcdStats stats = DCD_STATS_INIT;
    DcdClientDef client_def = DCD_CLIENT_DEF_INIT;
    DcdParticipantDef participant_def = DCD_PARTICIPANT_DEF_INIT;
    return world_def.struct_size + body_def.struct_size + joint_def.struct_size + joint_motor.model + filter.struct_size + ray.flags +
                   shape_cast.flags + point_query.flags + shape_query.reserved + box_query.reserved + body_properties.struct_size +
                   part_properties.struct_size + joint_info.struct_size + world_info.struct_size +
                   body_info.struct_size + state_view.struct_size + event_view.struct_size + stats.struct_size +
                   client_def.struct_size + participant_def.struct_size ==
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
    let output = command.args(STRICT).args(flags).arg("-fsyntax-only").arg(&path).output().unwrap();
    assert!(output.status.success(), "{flags:?}: {}", String::from_utf8_lossy(&output.stderr));
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
