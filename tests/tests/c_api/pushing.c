/* Explosions, water, wind and triggers: their effects across borders, and their errors. */
#include "checks.h"

#include <math.h>

static bool near(double a, double b, double within)
{
    return fabs(a - b) <= within;
}

static DcdBodyId box_at(DcdWorld world, double x, double y, double z, float density)
{
    const float half[3] = { 0.5f, 0.5f, 0.5f };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId box = { 0 };
    OK(dcd_shape_box(world, half, &def.shape));
    def.pose.p[0] = x;
    def.pose.p[1] = y;
    def.pose.p[2] = z;
    def.density = density;
    OK(dcd_body_create(world, &def, &box));
    return box;
}

static void motion_of(DcdWorld world, DcdBodyId body, DcdPose *pose, DcdVelocity *velocity)
{
    OK(dcd_body_get(world, body, pose, velocity));
}

/* A blast pushes a face of 1 m² of each box, on both sides of the border. The box of half the mass becomes
 * twice as fast. */
static void explosions(DcdWorld world)
{
    DcdExplosion blast = DCD_EXPLOSION_INIT;
    DcdBodyId right = box_at(world, 3.0, 20.0, 0.0, 4.0f), left = box_at(world, -3.0, 20.0, 0.0, 2.0f);
    DcdVelocity velocity;
    size_t pushed = 9;

    blast.centre[1] = 20.0;
    blast.impulse = 4.0f;
    OK(dcd_explode(world, &blast, &pushed));
    HOLDS(pushed == 2);
    motion_of(world, right, NULL, &velocity);
    HOLDS(near(velocity.linear[0], 1.0, 1e-4) && near(velocity.linear[1], 0.0, 1e-4));
    motion_of(world, left, NULL, &velocity);
    HOLDS(near(velocity.linear[0], -2.0, 1e-4));
    blast.mask = 0;
    OK(dcd_explode(world, &blast, &pushed));
    HOLDS(pushed == 0);
    blast.mask = 1;
    OK(dcd_explode(world, &blast, NULL));
    OK(dcd_body_destroy(world, right));
    OK(dcd_body_destroy(world, left));

    const DcdExplosion good = DCD_EXPLOSION_INIT;
    pushed = 7;
#define REFUSED(member, value, word) \
    (blast = good, blast.member = (value), FAILS(dcd_explode(world, &blast, &pushed), DCD_ERR_ARGUMENT, word))
    REFUSED(centre[0], NAN, "centre");
    REFUSED(centre[2], 1e10, "centre");
    REFUSED(radius, -1.0f, "radius");
    REFUSED(falloff, INFINITY, "falloff");
    REFUSED(impulse, NAN, "impulse");
    REFUSED(reserved, 1, "reserved");
#undef REFUSED
    blast = good;
    blast.struct_size = 8;
    FAILS(dcd_explode(world, &blast, &pushed), DCD_ERR_STRUCT, "DcdExplosion");
    FAILS(dcd_explode(world, NULL, &pushed), DCD_ERR_NULL, "explosion");
    FAILS(dcd_explode((DcdWorld){ 0 }, &good, &pushed), DCD_ERR_NULL, "world");
    HOLDS(pushed == 7);
}

/* A body of half the density of water floats half submerged, and drifts with the current. */
static void fluids(DcdWorld world)
{
    DcdFluid lake = DCD_FLUID_INIT;
    DcdBodyId raft = box_at(world, 0.0, 10.0, 0.0, 500.0f), bird = box_at(world, 0.0, 40.0, 0.0, 500.0f);
    DcdPose pose;
    DcdVelocity velocity;
    size_t pushed = 0;

    lake.surface = 10.0;
    lake.max[1] = 20.0;
    lake.velocity[2] = 0.5f;
    for (int step = 0; step < 900; step++) {
        OK(dcd_flow(world, &lake, &pushed));
        HOLDS(pushed == 1);
        OK(dcd_body_set_velocity(world, bird, &(DcdVelocity){ { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }));
        OK(dcd_step(world));
    }
    motion_of(world, raft, &pose, &velocity);
    HOLDS(near(pose.p[1], 10.0, 0.01) && near(velocity.linear[1], -0.04, 0.045));
    HOLDS(pose.p[2] > 3.0 && velocity.linear[2] > 0.4f && velocity.linear[2] <= 0.5f);
    lake.max[0] = -30.0;
    OK(dcd_flow(world, &lake, &pushed));
    HOLDS(pushed == 0);
    OK(dcd_flow(world, &lake, NULL));
    OK(dcd_body_destroy(world, raft));
    OK(dcd_body_destroy(world, bird));

    const DcdFluid good = DCD_FLUID_INIT;
    pushed = 7;
#define REFUSED(member, value, word) \
    (lake = good, lake.member = (value), FAILS(dcd_flow(world, &lake, &pushed), DCD_ERR_ARGUMENT, word))
    REFUSED(min[1], 2e9, "min");
    REFUSED(max[0], NAN, "min");
    REFUSED(surface, NAN, "surface");
    REFUSED(density, -1.0f, "density");
    REFUSED(velocity[1], INFINITY, "velocity");
    REFUSED(drag, NAN, "drag");
    REFUSED(damping, -0.5f, "damping");
#undef REFUSED
    lake = good;
    lake.struct_size = 8;
    FAILS(dcd_flow(world, &lake, &pushed), DCD_ERR_STRUCT, "DcdFluid");
    FAILS(dcd_flow(world, NULL, &pushed), DCD_ERR_NULL, "fluid");
    lake = good;
    lake.lift = -1.0f;
    FAILS(dcd_flow(world, &lake, &pushed), DCD_ERR_ARGUMENT, "lift");
    lake = good;
    lake.reserved = 1;
    FAILS(dcd_flow(world, &lake, &pushed), DCD_ERR_ARGUMENT, "reserved");
    FAILS(dcd_flow((DcdWorld){ 0 }, &good, &pushed), DCD_ERR_NULL, "world");
    HOLDS(pushed == 7);
}

/* The zone lies across the border. Each region owns one of the two bodies inside. */
static void triggers(DcdWorld world)
{
    const float half[3] = { 2.0f, 2.0f, 2.0f };
    DcdBodyDef def = DCD_BODY_DEF_INIT;
    DcdBodyId zone, inside[4] = { { 0 }, { 0 }, { 0 }, { 0 } };
    size_t count = 9;
    OK(dcd_shape_box(world, half, &def.shape));
    def.body_type = DCD_FIXED;
    def.flags = DCD_BODY_SENSOR;
    OK(dcd_body_create(world, &def, &zone));
    DcdBodyId right = box_at(world, 1.5, 0.0, 0.0, 4.0f), left = box_at(world, -1.5, 0.0, 0.0, 2.0f);
    DcdBodyId far = box_at(world, 9.0, 0.0, 0.0, 2.0f);

    OK(dcd_sensor_bodies(world, zone, 0, inside, 4, &count));
    HOLDS(count == 2 && inside[0].v == right.v && inside[1].v == left.v && inside[2].v == 0);
    OK(dcd_sensor_bodies(world, zone, 0, NULL, 0, &count));
    HOLDS(count == 2);
    inside[0].v = 1;
    FAILS(dcd_sensor_bodies(world, zone, 0, inside, 1, &count), DCD_ERR_SMALL_BUFFER, "out");
    HOLDS(count == 2 && inside[0].v == 1);
    OK(dcd_body_destroy(world, right));
    OK(dcd_sensor_bodies(world, zone, 0, inside, 4, &count));
    HOLDS(count == 1 && inside[0].v == left.v);
    /* A sensor that is disabled or enabled is so at once. */
    DcdBodyProperties as = DCD_BODY_PROPERTIES_INIT;
    OK(dcd_body_properties(world, zone, &as));
    for (size_t i = 0; i < 4; i++) {
        as.flags ^= DCD_BODY_DISABLED;
        OK(dcd_body_set_properties(world, zone, &as));
        for (int step = 0; step < 2; step++) {
            OK(dcd_sensor_bodies(world, zone, 0, NULL, 0, &count));
            HOLDS(count == i % 2);
            if (i < 2)
                OK(dcd_step(world));
        }
    }
    OK(dcd_sensor_bodies(world, zone, 0, inside, 4, &count));
    FAILS(dcd_sensor_bodies(world, zone, 1, inside, 4, &count), DCD_ERR_ARGUMENT, "sensor");
    FAILS(dcd_sensor_bodies(world, far, 0, inside, 4, &count), DCD_ERR_ARGUMENT, "sensor");
    FAILS(dcd_sensor_bodies(world, right, 0, inside, 4, &count), DCD_ERR_STALE_ID, "body");
    FAILS(dcd_sensor_bodies(world, (DcdBodyId){ 0 }, 0, inside, 4, &count), DCD_ERR_NULL, "body");
    FAILS(dcd_sensor_bodies(world, zone, 0, NULL, 4, &count), DCD_ERR_NULL, "out");
    FAILS(dcd_sensor_bodies(world, zone, 0, inside, 4, NULL), DCD_ERR_NULL, "count");
    HOLDS(count == 1);
}

int main(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdWorld world;
    def.regions = 2;
    OK(dcd_world_create(&def, &world));
    explosions(world);
    fluids(world);
    triggers(world);
    OK(dcd_world_destroy(world));
    const DcdExplosion blast = DCD_EXPLOSION_INIT;
    FAILS(dcd_explode(world, &blast, NULL), DCD_ERR_STALE_ID, "world");
    return checked();
}
