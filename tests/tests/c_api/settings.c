/* Settings of a running world change: gravity, length of a step, solver, units. */
#include "checks.h"

#include <math.h>

static DcdSettings settings_of(DcdWorld world)
{
    DcdSettings settings = DCD_SETTINGS_INIT;
    OK(dcd_settings(world, &settings));
    return settings;
}

static float speed_limit_of(DcdWorld world)
{
    DcdWorldInfo info = DCD_WORLD_INFO_INIT;
    OK(dcd_world_info(world, &info));
    return info.speed_limit;
}

static DcdBodyId ball_at(DcdWorld world, double x, double y)
{
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId ball = { 0 };
    OK(dcd_shape_sphere(world, 0.5f, &def.shape));
    def.pose.p[0] = x;
    def.pose.p[1] = y;
    OK(dcd_body_create(world, &def, &ball));
    return ball;
}

static float speed_of(DcdWorld world, DcdBodyId body, int axis)
{
    DcdVelocity velocity;
    OK(dcd_body_get(world, body, NULL, &velocity));
    return velocity.linear[axis];
}

/* Gravity is turned, for falling and for sleeping bodies, in both regions. A saved world keeps it. */
static void gravity(DcdWorld world)
{
    const float slab[3] = { 20.0f, 0.5f, 20.0f }, up[3] = { 0.0f, 3.0f, 0.0f };
    static char saved[1 << 20];
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId floor, left, right;
    DcdBodyInfo info = DCD_BODY_INFO_INIT;
    DcdWorldInfo about = DCD_WORLD_INFO_INIT;
    size_t size = 0;
    def.body_type = DCD_FIXED;
    def.pose.p[1] = -0.5;
    OK(dcd_shape_box(world, slab, &def.shape));
    OK(dcd_body_create(world, &def, &floor));
    left = ball_at(world, -3.0, 0.5);
    right = ball_at(world, 3.0, 0.5);
    for (int i = 0; i < 300 && !info.sleeping; i++) {
        OK(dcd_step(world));
        OK(dcd_body_info(world, right, &info));
    }
    HOLDS(info.sleeping);
    OK(dcd_gravity_set(world, up));
    OK(dcd_world_info(world, &about));
    HOLDS(about.gravity[1] == 3.0f && settings_of(world).gravity[1] == 3.0f);
    for (int i = 0; i < 60; i++)
        OK(dcd_step(world));
    HOLDS(fabs(speed_of(world, left, 1) - 3.0) < 0.05 && fabs(speed_of(world, right, 1) - 3.0) < 0.05);
    OK(dcd_snapshot_save(world, saved, sizeof saved, &size));
    OK(dcd_gravity_set(world, (const float[3]){ 0.0f, 0.0f, 0.0f }));
    OK(dcd_snapshot_load(world, saved, size));
    HOLDS(settings_of(world).gravity[1] == 3.0f);
}

/* Steps become 5 ms long, and then the speed limit 2 m/s. */
static void steps(DcdWorld world)
{
    DcdSettings settings = settings_of(world);
    const DcdSettings before = settings;
    const DcdBodyId ball = ball_at(world, 3.0, 50.0);
    const DcdVelocity fast = { { 0.0f, 3.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    HOLDS(settings.solver_iterations == 4 && settings.length_unit == 1.0f && settings.warm_start == 1.0f);
    HOLDS(settings.speed_limit == 400.0f && settings.contact_frequency > 0.0f && settings.ccd_substeps == 1);
    settings.gravity[1] = -10.0f;
    settings.dt = 0.005f;
    OK(dcd_settings_set(world, &settings));
    for (int i = 0; i < 100; i++)
        OK(dcd_step(world));
    HOLDS(fabs(speed_of(world, ball, 1) + 5.0) < 0.01);
    settings.speed_limit = 2.0f;
    OK(dcd_settings_set(world, &settings));
    OK(dcd_step(world));
    OK(dcd_step(world));
    HOLDS(fabs(speed_of(world, ball, 1)) < 2.1);
    settings = settings_of(world);
    HOLDS(settings.dt == 0.005f && settings.speed_limit == 2.0f);
    HOLDS(speed_limit_of(world) == 2.0f);
    FAILS(dcd_body_set_velocity(world, ball, &fast), DCD_ERR_ARGUMENT, "2 m/s");
    OK(dcd_settings_set(world, &before));
    settings = settings_of(world);
    HOLDS(memcmp(&before, &settings, sizeof before) == 0 && speed_limit_of(world) == 400.0f);
    OK(dcd_body_set_velocity(world, ball, &fast));
    OK(dcd_body_destroy(world, ball));
}

/* The unit is a centimetre: a body that drifts by 2 cm/s falls asleep, as one at 0.02 m/s in metres. The
 * speed limit keeps its number. */
static void centimetres(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdVelocity drift = { { 2.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } };
    DcdWorld world;
    OK(dcd_world_create(&def, &world));
    OK(dcd_gravity_set(world, (const float[3]){ 0.0f, 0.0f, 0.0f }));
    for (int unit = 1; unit <= 100; unit += 99) {
        DcdSettings settings = settings_of(world);
        DcdBodyInfo info = DCD_BODY_INFO_INIT;
        DcdBodyId ball = ball_at(world, 0.0, 5.0);
        settings.length_unit = (float)unit;
        settings.speed_limit = 100.0f;
        OK(dcd_settings_set(world, &settings));
        HOLDS(settings_of(world).length_unit == (float)unit && settings_of(world).speed_limit == 100.0f);
        HOLDS(speed_limit_of(world) == 100.0f);
        OK(dcd_body_set_velocity(world, ball, &drift));
        for (int i = 0; i < 120; i++)
            OK(dcd_step(world));
        OK(dcd_body_info(world, ball, &info));
        HOLDS(info.sleeping == (unit == 100));
        OK(dcd_body_set_force(world, ball, (const float[3]){ 1e6f, 0.0f, 0.0f }, NULL));
        for (int i = 0; i < 60; i++)
            OK(dcd_step(world));
        HOLDS(fabs(speed_of(world, ball, 0) - 100.0) < 0.1);
        OK(dcd_body_destroy(world, ball));
    }
    OK(dcd_world_destroy(world));
}

/* Where a box comes to that slides and spins on the floor. */
static DcdPose slid(DcdFrictionModel model)
{
    const float slab[3] = { 20.0f, 0.5f, 20.0f }, half[3] = { 0.5f, 0.5f, 1.0f };
    const DcdVelocity thrown = { { 4.0f, 0.0f, 0.0f }, { 0.0f, 6.0f, 0.0f } };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdWorld world;
    DcdBodyId box;
    DcdPose pose = { { 0 }, { 0 } };
    OK(dcd_world_create(&def, &world));
    DcdSettings settings = settings_of(world);
    HOLDS(settings.friction_model == DCD_FRICTION_SIMPLIFIED);
    settings.friction_model = model;
    OK(dcd_settings_set(world, &settings));
    HOLDS(settings_of(world).friction_model == model);
    OK(dcd_shape_box(world, slab, &body.shape));
    body.body_type = DCD_FIXED;
    body.pose.p[1] = -0.5;
    OK(dcd_body_create(world, &body, &box));
    body = (DcdBodyDef)DCD_BODY_DEF_INIT;
    OK(dcd_shape_box(world, half, &body.shape));
    body.pose.p[1] = 0.5;
    body.velocity = thrown;
    OK(dcd_body_create(world, &body, &box));
    for (int i = 0; i < 90; i++)
        OK(dcd_step(world));
    OK(dcd_body_get(world, box, &pose, NULL));
    HOLDS(pose.p[0] > 0.5 && pose.p[0] < 4.0);
    OK(dcd_world_destroy(world));
    return pose;
}

/* The models of friction stop it at different places, each always at the same. */
static void friction(void)
{
    const DcdPose plain = slid(DCD_FRICTION_SIMPLIFIED), coulomb = slid(DCD_FRICTION_COULOMB), again = slid(DCD_FRICTION_COULOMB);
    HOLDS(memcmp(&coulomb, &again, sizeof again) == 0);
    HOLDS(fabs(plain.p[0] - coulomb.p[0]) + fabs(plain.q[1] - coulomb.q[1]) > 1e-3);
}

/* The times of a step's phases, and the counts of what was computed. */
static void costs(DcdWorld world)
{
    DcdProfile profile = DCD_PROFILE_INIT;
    DcdStats stats = DCD_STATS_INIT;
    DcdBodyId one = ball_at(world, 0.0, 20.0), other = ball_at(world, 0.0, 20.9); /* they touch each other at the border */
    OK(dcd_step(world));
    OK(dcd_profile(world, &profile));
    OK(dcd_stats(world, &stats));
    HOLDS(profile.rapier > 0.0 && profile.border > 0.0 && profile.border < stats.last_step);
    const double phases = profile.broad_phase + profile.narrow_phase + profile.islands + profile.solver + profile.ccd;
#ifdef PROFILER /* with a library that has the feature: benches/README.md */
    HOLDS(profile.broad_phase > 0.0 && profile.narrow_phase > 0.0 && profile.solver > 0.0 && phases <= profile.rapier);
#else
    HOLDS(phases == 0.0);
#endif
    HOLDS(profile.islands_awake >= 1 && profile.islands_awake < profile.awake && profile.memory > 1000 * profile.awake);
    HOLDS(profile.awake >= 2 && profile.contact_pairs >= 1 && profile.contacts >= 1 && profile.joints == 0);
    OK(dcd_body_destroy(world, one));
    OK(dcd_body_destroy(world, other));
    FAILS(dcd_profile(world, NULL), DCD_ERR_NULL, "out");
    profile.struct_size = 1;
    FAILS(dcd_profile(world, &profile), DCD_ERR_STRUCT, "DcdProfile");
}

static DcdFidelityReport report_of(DcdWorld world)
{
    DcdFidelityReport report = DCD_FIDELITY_REPORT_INIT;
    OK(dcd_fidelity_report(world, &report));
    return report;
}

/* A town that is looked at from one corner: what is far from there is computed less often. Looked at as a
 * whole, the town is computed in full. */
static void fidelity(DcdFidelity asked, float limit)
{
    const char *params[2] = { "n=600", "cars=2" };
    const DcdViewpoint corner = { { -120.0, 2.0, -60.0 }, 50.0 };
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdFidelityReport report;
    DcdWorld world;
    def.fidelity = asked;
    def.fidelity_limit = limit;
    def.threads = 1;
    OK(dcd_world_open_scene("town", params, 2, &def, &world));
    OK(dcd_viewpoints_set(world, &corner, 1));
    for (int i = 0; i < 80; i++)
        OK(dcd_step(world));
    report = report_of(world);
    if (asked == DCD_FIDELITY_OFF) {
        HOLDS(report.share_of_full_time == 1.0 && report.audits == 0 && report.levels[2] == 0);
    } else {
        HOLDS(report.share_of_full_time > 0.0 && report.share_of_full_time < 1.0 && report.levels[2] > 0);
        HOLDS(report.low95 <= report.error && report.error <= report.high95 && report.audits > 0);
    }
    OK(dcd_viewpoints_set(world, NULL, 0)); /* all of it is in sight */
    for (int i = 0; i < 8; i++)
        OK(dcd_step(world));
    report = report_of(world);
    HOLDS(report.levels[1] == 0 && report.levels[2] == 0);
    OK(dcd_world_destroy(world));
}

static void misuse_of_fidelity(DcdWorld world)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdViewpoint view = { { 0.0, 0.0, 0.0 }, -1.0 };
    DcdFidelityReport report = DCD_FIDELITY_REPORT_INIT;
    DcdWorld none;
    FAILS(dcd_viewpoints_set(world, NULL, 1), DCD_ERR_NULL, "viewpoints");
    FAILS(dcd_viewpoints_set(world, &view, 1), DCD_ERR_ARGUMENT, "radius is -1");
    view.radius = NAN;
    FAILS(dcd_viewpoints_set(world, &view, 1), DCD_ERR_ARGUMENT, "radius");
    view.radius = 1.0;
    view.at[1] = INFINITY;
    FAILS(dcd_viewpoints_set(world, &view, 1), DCD_ERR_ARGUMENT, "at");
    FAILS(dcd_fidelity_report(world, NULL), DCD_ERR_NULL, "out");
    report.struct_size = 1;
    FAILS(dcd_fidelity_report(world, &report), DCD_ERR_STRUCT, "DcdFidelityReport");
    def.fidelity = DCD_FIDELITY_BUDGET + 1;
    FAILS(dcd_world_create(&def, &none), DCD_ERR_ARGUMENT, "fidelity is 5");
    def.fidelity = DCD_FIDELITY_BUDGET;
    FAILS(dcd_world_create(&def, &none), DCD_ERR_ARGUMENT, "fidelity_limit is 0");
    def.fidelity_limit = NAN;
    FAILS(dcd_world_create(&def, &none), DCD_ERR_ARGUMENT, "fidelity_limit is NaN");
    def.fidelity = DCD_FIDELITY_AUTO;
    def.fidelity_limit = 1.0f;
    FAILS(dcd_world_open_scene("town", NULL, 0, &def, &none), DCD_ERR_ARGUMENT, "fidelity_limit is 1");
    def.fidelity_limit = 0.0f;
    def.coupling = DCD_COUPLING_OWNER;
    FAILS(dcd_world_create(&def, &none), DCD_ERR_ARGUMENT, "fidelity");
}

static void misuse(DcdWorld world)
{
    const DcdSettings good = settings_of(world);
    DcdSettings bad = good;
    FAILS(dcd_settings(world, NULL), DCD_ERR_NULL, "out");
    FAILS(dcd_settings_set(world, NULL), DCD_ERR_NULL, "settings");
    FAILS(dcd_settings((DcdWorld){ 0 }, &bad), DCD_ERR_NULL, "world");
    FAILS(dcd_gravity_set(world, NULL), DCD_ERR_NULL, "gravity");
    FAILS(dcd_gravity_set(world, (const float[3]){ NAN, 0.0f, 0.0f }), DCD_ERR_ARGUMENT, "gravity");
    bad.struct_size--;
    FAILS(dcd_settings_set(world, &bad), DCD_ERR_STRUCT, "DcdSettings");
    FAILS(dcd_settings(world, &bad), DCD_ERR_STRUCT, "DcdSettings");
#define REFUSED(member, value) \
    bad = good; \
    bad.member = (value); \
    FAILS(dcd_settings_set(world, &bad), DCD_ERR_ARGUMENT, #member)
    REFUSED(solver_iterations, 0);
    bad = good;
    bad.dt = -1.0f;
    FAILS(dcd_settings_set(world, &bad), DCD_ERR_ARGUMENT, "dt");
    bad = good;
    bad.gravity[2] = INFINITY;
    FAILS(dcd_settings_set(world, &bad), DCD_ERR_ARGUMENT, "gravity");
    REFUSED(length_unit, 0.0f);
    REFUSED(length_unit, NAN);
    REFUSED(speed_limit, 0.0f);
    REFUSED(speed_limit, -1.0f);
    REFUSED(speed_limit, NAN);
    REFUSED(speed_limit, INFINITY);
    REFUSED(contact_frequency, NAN);
    REFUSED(contact_damping, -1.0f);
    REFUSED(static_frequency, INFINITY);
    REFUSED(static_damping, NAN);
    REFUSED(max_correction, -0.5f);
    REFUSED(allowed_overlap, -0.5f);
    REFUSED(contact_margin, NAN);
    REFUSED(warm_start, 1.5f);
    REFUSED(internal_iterations, 0);
    REFUSED(ccd_substeps, 1001);
    REFUSED(tolerance, 0.0f);
    REFUSED(friction_model, 2);
    REFUSED(friction_model, UINT32_MAX);
    bad = settings_of(world);
    HOLDS(memcmp(&bad, &good, sizeof good) == 0);
}

int main(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    def.regions = 2;
    OK(dcd_world_create(&def, &world));
    misuse(world);
    costs(world);
    gravity(world);
    steps(world);
    centimetres();
    friction();
    misuse_of_fidelity(world);
    fidelity(DCD_FIDELITY_OFF, 0.0f);
    fidelity(DCD_FIDELITY_AUTO, 0.0f);
    fidelity(DCD_FIDELITY_TOLERANCE, 1.0f);
    OK(dcd_world_destroy(world));
    FAILS(dcd_gravity_set(world, (const float[3]){ 0.0f, 0.0f, 0.0f }), DCD_ERR_STALE_ID, "world");
    return checked();
}
