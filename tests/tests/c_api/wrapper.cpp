/* The variant of dcd.hpp whose calls return a result; each is called at least once. A ball breaks a tower in
 * a world of two regions, handles clean up after themselves, failed calls say why. throwing.cpp, in the same
 * program, has the calls that throw. */
#include "dcd.hpp"
#include "dcd.hpp"

#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <type_traits>
#include <unordered_map>
#if __cplusplus >= 202002L
#include <span>
#endif

/* Runs the checks of exceptions in throwing.cpp. Returns the number of failures. */
int throwing_failures();

static int checks, failures;

#define HOLDS(what) holds(bool(what), #what, __LINE__)

static void holds(bool what, const char *text, int line)
{
    checks++;
    if (!what) {
        std::printf("line %d: not so: %s (last error: %s)\n", line, text, dcd::last_error().c_str());
        failures++;
    }
}

/* Answers from a kept object are spans; answers from a temporary, which would dangle, are copied. */
template <class F> using Told = decltype(std::declval<F>().of(0));
static_assert(std::is_same_v<Told<const dcd::Found<dcd::Overlap> &>, dcd::Span<const dcd::Overlap>>, "kept");
static_assert(std::is_same_v<Told<dcd::Found<dcd::Overlap>>, std::vector<dcd::Overlap>>, "temporary");

static dcd::World make_world()
{
    dcd::WorldDef def;
    def.regions = 2;
    def.threads = 1;
    def.user_data = 7;
    dcd::Result<dcd::World> world = dcd::World::create(def);
    HOLDS(world);
    return *std::move(world);
}

static dcd::BodyId add_floor(dcd::World &world)
{
    dcd::BodyDef def;
    def.body_type = DCD_FIXED;
    def.shape = *world.shape_box({ 20.0f, 0.5f, 20.0f });
    def.pose.p[1] = -0.5;
    return *world.body_create(def);
}

/* A blast throws a ball up, water bears it, and a function that is asked about contacts lets it fall through the floor. */
static void effects_are_seen()
{
    dcd::World world = make_world();
    const dcd::BodyId floor = add_floor(world);
    dcd::BodyDef def;
    def.shape = *world.shape_sphere(0.5f);
    def.pose.p[1] = 0.5;
    def.hooks = DCD_HOOK_FILTER;
    def.flags = DCD_BODY_NO_SLEEP;
    const dcd::BodyId ball = *world.body_create(def);
    dcd::Explosion blast;
    blast.centre[1] = -0.5;
    blast.impulse = 2000.0f;
    HOLDS(*world.explode(blast) == 1 && world.body_get(ball)->velocity.linear[1] > 1.0f);

    dcd::Fluid water;
    water.surface = 10.0;
    water.density = 2000.0f;
    HOLDS(world.body_set_velocity(ball, { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }));
    HOLDS(*world.flow(water) == 1 && world.step() && world.body_get(ball)->velocity.linear[1] > 0.1f);

    std::atomic<int> asked{ 0 };
    dcd::Hooks hooks;
    hooks.context = &asked;
    hooks.filter = [](void *context, const dcd::HookedPair *) -> DcdPairAnswer {
        static_cast<std::atomic<int> *>(context)->fetch_add(1);
        return DCD_MEET_NOT;
    };
    HOLDS(world.hooks_set(hooks) && world.body_set_pose(ball, def.pose));
    for (int i = 0; i < 30; i++) {
        HOLDS(world.step());
    }
    const int calls = asked.load();
    HOLDS(calls > 0 && world.body_get(ball)->pose.p[1] < -0.2);
    HOLDS(world.hooks_clear() && world.body_set_pose(ball, def.pose));
    HOLDS(world.body_set_velocity(ball, { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }));
    for (int i = 0; i < 30; i++) {
        HOLDS(world.step());
    }
    HOLDS(asked.load() == calls && world.body_get(ball)->pose.p[1] > 0.4 && !world.body_contacts(floor)->empty());
}

static void a_ball_breaks_a_tower()
{
    dcd::World world = make_world();
    add_floor(world);
    std::vector<dcd::BodyDef> defs(5);
    const dcd::ShapeId box = *world.shape_box({ 0.5f, 0.5f, 0.5f });
    std::unordered_map<dcd::BodyId, int> floors;
    for (std::size_t i = 0; i < defs.size(); i++) {
        defs[i].shape = box;
        defs[i].pose.p[1] = 0.5 + static_cast<double>(i);
    }
    const std::vector<dcd::BodyId> tower = *world.bodies_create(defs);
    for (int i = 0; i < 5; i++) {
        floors[tower[static_cast<std::size_t>(i)]] = i;
    }

    dcd::BodyDef def;
    def.shape = *world.shape_sphere(0.5f);
    def.pose.p[0] = -5.0;
    def.pose.p[1] = 2.5;
    def.density = 8000.0f;
    def.events = DCD_EVENT_CONTACT;
    const dcd::BodyId ball = *world.body_create(def);
    const float mass = world.body_info(ball)->mass;
    HOLDS(std::fabs(mass - 4189.0f) < 50.0f);
    HOLDS(world.body_apply_impulse(ball, { 20.0f * mass, 0.0f, 0.0f }));
    HOLDS(std::fabs(world.body_get(ball)->velocity.linear[0] - 20.0f) < 1e-3f);

    int met = -1;
    for (int i = 0; i < 120; i++) {
        HOLDS(world.step());
        const dcd::Result<dcd::EventView> events = world.events();
        for (const dcd::Contact &contact : events->contacts()) {
            const auto other = floors.find(contact.a == ball ? contact.b : contact.a);
            if (met < 0 && contact.kind == DCD_CONTACT_BEGAN && other != floors.end()) {
                met = other->second;
            }
        }
    }
    HOLDS(met >= 1 && met <= 3);
    HOLDS(world.body_get(tower[4])->pose.p[1] < 4.0);

    /* The same bodies from the view, from a copy into the game's own structs, and one by one. */
    const dcd::StateView view = *world.state_view();
    HOLDS(view.tick() == 120 && view.size() == 6 && view.poses().size() == 6 && !view.ids().empty());
    struct Sprite {
        std::uint32_t colour;
        dcd::Pose pose;
    };
    HOLDS(view.slots().size() == 6 && view.slot_count() == 6 && view.slots()[5] == 5);
    std::vector<Sprite> sprites(view.size());
    HOLDS(world.state_read(view.ids(), &sprites[0].pose, sizeof(Sprite)));
    for (std::size_t i = 0; i < view.size(); i++) {
        HOLDS(std::memcmp(&sprites[i].pose, &view.poses()[i], sizeof(dcd::Pose)) == 0);
        HOLDS(std::memcmp(&world.body_get(view.ids()[i])->velocity, &view.velocities()[i], sizeof(dcd::Velocity)) == 0);
    }
#if __cplusplus >= 202002L
    const std::span<const dcd::Pose> poses = view.poses();
    HOLDS(poses.size() == 6);
#endif

    dcd::DebugDraw draw;
    std::vector<dcd::BodyId> drawn;
    draw.context = &drawn;
    draw.draw_shape = [](void *context, dcd::BodyId body, const dcd::DrawnShape *, const dcd::Pose *, std::uint32_t) {
        static_cast<std::vector<dcd::BodyId> *>(context)->push_back(body);
    };
    HOLDS(world.debug_draw(draw));
    HOLDS(drawn.size() == 7 && drawn.back() == ball);

    const std::vector<dcd::ContactPoint> touching = *world.body_contacts(tower[0]);
    HOLDS(!touching.empty() && (touching[0].a == tower[0] || touching[0].b == tower[0]));
    dcd::Explosion blast;
    blast.centre[1] = -30.0;
    HOLDS(*world.explode(blast) == 0);
    dcd::Fluid water;
    water.surface = -40.0;
    HOLDS(*world.flow(water) == 0);
    HOLDS(world.sensor_bodies(ball).status().code() == DCD_ERR_ARGUMENT);
    dcd::Hooks hooks;
    hooks.filter = [](void *, const dcd::HookedPair *) -> DcdPairAnswer { return DCD_MEET_PUSH; };
    HOLDS(world.hooks_set(hooks) && world.hooks_clear());
    HOLDS(world.tasks_set({}).code() == DCD_ERR_NULL && world.tasks_clear() && dcd::bug_set(nullptr, nullptr));
    HOLDS(std::string(dcd::refused_string(0)).size() > 0);
    HOLDS(dcd::allocator_set(nullptr, nullptr, nullptr).code() == DCD_ERR_NULL);
    HOLDS(world.profile()->rapier >= 0.0);
    HOLDS(world.viewpoints_set(std::vector<dcd::Viewpoint>{ { { 0.0, 1.0, 0.0 }, 5.0 } }) && world.viewpoints_set({}));
    HOLDS(world.fidelity_report()->share_of_full_time == 1.0);
    dcd::Settings settings = *world.settings();
    HOLDS(settings.gravity[1] == -9.81f && settings.length_unit == 1.0f);
    settings.solver_iterations = 6;
    HOLDS(world.settings_set(settings) && world.gravity_set({ 0.0f, -9.81f, 0.0f }));
    HOLDS(world.settings()->solver_iterations == 6);
    const std::vector<dcd::BodyId> all = *world.bodies();
    HOLDS(all.size() == 7 && all.back() == ball);
    const dcd::ShapeInfo looks = *world.shape_info(*world.collider_shape(ball));
    HOLDS(looks.kind == DCD_SHAPE_SPHERE && looks.size[0] == 0.5f);
    HOLDS(std::fabs(world.body_extent(ball)->mass - mass) < 1.0f);
    const dcd::Vec3 corners[] = { { 0.0f, 0.0f, 0.0f }, { 1.0f, 0.0f, 0.0f }, { 0.0f, 1.0f, 0.0f }, { 0.0f, 0.0f, 1.0f } };
    const dcd::ShapeId hull = *world.shape_hull(corners);
    HOLDS(world.shape_vertices(hull)->size() == 4 && world.shape_triangles(hull)->size() == 4);
    HOLDS(world.shape_heights(hull)->empty() && world.shape_part(hull, 0).status().code() == DCD_ERR_ARGUMENT);
    HOLDS(world.shape_destroy(hull));

    std::vector<std::uint64_t> colours(view.size(), 3);
    HOLDS(world.state_write(view.ids(), colours.data()));
    HOLDS(world.body_info(ball)->user_data == 3);

    dcd::Ray ray;
    ray.origin[0] = ray.origin[2] = 15.0;
    ray.origin[1] = 5.0;
    ray.direction[1] = -1.0f;
    ray.max_distance = 10.0f;
    const dcd::Ray rays[] = { ray, ray };
    const std::vector<dcd::RayHit> hits = *world.cast_rays(rays);
    HOLDS(hits.size() == 2 && std::fabs(hits[1].distance - 5.0f) < 1e-3f);
    const dcd::QueryId query = *world.cast_rays_submit(rays), spare = *world.cast_rays_submit(rays);
    HOLDS(query != spare && world.query_cancel(spare));
    const std::optional<std::vector<dcd::RayHit>> polled = *world.query_poll(query);
    HOLDS(polled && polled->size() == 2 && (*polled)[1].distance == hits[1].distance);
    HOLDS(world.query_poll(query).status().code() == DCD_ERR_STALE_ID);
    dcd::BoxQuery around;
    around.min[0] = around.min[1] = around.min[2] = -1e9;
    around.max[0] = around.max[1] = around.max[2] = 1e9;
    const dcd::BoxQuery boxes[] = { around };
    const dcd::QueryId asked = *world.overlap_boxes_submit(boxes);
    const std::optional<dcd::Found<dcd::Overlap>> there = *world.query_poll_overlaps(asked, 1);
    HOLDS(there && there->of(0).size() == world.overlap_boxes(boxes)->of(0).size() && there->of(0).size() > 1);
    HOLDS(world.query_poll_overlaps(asked, 1).status().code() == DCD_ERR_STALE_ID);
    dcd::ShapeCast cast;
    cast.shape = *world.shape_sphere(0.25f);
    cast.pose.p[0] = cast.pose.p[2] = 15.0;
    cast.pose.p[1] = 5.0;
    cast.motion[1] = -10.0f;
    const dcd::ShapeCast casts[] = { cast };
    const dcd::ShapeHit touched = world.cast_shapes(casts)->at(0);
    HOLDS((*world.query_poll_casts(*world.cast_shapes_submit(casts)))->at(0).fraction == touched.fraction && touched.body == hits[1].body);
    const dcd::Found<dcd::RayHit> through = *world.cast_rays_all(rays);
    HOLDS(through.of(0).size() == 1 && through.of(1).size() == 1 && through.of(1)[0].body == hits[1].body);
    dcd::Filter movable;
    movable.flags = DCD_FILTER_NO_FIXED;
    int calls = 0;
    const auto goes_on = [&calls](const dcd::RayHit &hit) { return ++calls, hit.distance; };
    world.cast_ray_each(rays[1], goes_on).expect();
    HOLDS(calls == 1);
    world.cast_ray_each(rays[1], goes_on, movable).expect();
    HOLDS(calls == 1);
    const auto meets = [&calls](const dcd::ShapeHit &hit) { return ++calls, hit.fraction; };
    world.cast_shape_each(cast, meets).expect();
    HOLDS(calls == 2);
    world.cast_shape_each(cast, meets, movable).expect();
    HOLDS(calls == 2);
    std::vector<DcdBodyId> near_by;
    const auto note = [&near_by](const dcd::Overlap &found) { return near_by.push_back(found.body), false; };
    world.overlap_box_each(around, note).expect();
    dcd::ShapeQuery sphere;
    sphere.shape = cast.shape;
    world.overlap_shape_each(sphere, note).expect();
    HOLDS(near_by.size() == 2);
    HOLDS((*world.cast_rays_all(rays, movable)).items.empty());
    dcd::PointQuery point;
    point.point[1] = -0.1;
    const dcd::PointQuery points[] = { point };
    HOLDS((*world.overlap_points(points)).of(0).size() == 1 && (*world.project_points(points)).size() == 1);

    const std::vector<unsigned char> saved = *world.snapshot_save();
    const std::uint64_t then = *world.state_hash();
    world.step_begin().expect();
    world.step_wait(60000000000u).expect();
    world.snapshot_load(saved).expect();
    HOLDS(*world.state_hash() == then);
    const DcdCheckpointId checkpoint = *world.checkpoint_create();
    world.step().expect();
    HOLDS(*world.state_hash() != then);
    world.checkpoint_restore(checkpoint).expect();
    HOLDS(*world.state_hash() == then);
    HOLDS(world.checkpoint_save(checkpoint) && world.checkpoint_destroy(checkpoint));
    HOLDS(world.checkpoint_restore(checkpoint).code() == DCD_ERR_STALE_ID);
    HOLDS(!world.address() && world.address().status().code() == DCD_ERR_UNSUPPORTED);
    HOLDS(!world.metrics_address() && world.metrics_address().status().code() == DCD_ERR_UNSUPPORTED);

    HOLDS(world.interest_set({ 0.0, 0.0, 0.0 }, 10.0));
    HOLDS(world.bandwidth_set(16000));
    HOLDS(world.borders()->size() == 1 && world.body_owner(ball)->flags == DCD_OWNER_HERE);
    HOLDS(world.regions()->size() == 2 && world.own_avatars()->empty());
    HOLDS(world.connections()->empty() && world.poll(1000));
    HOLDS(world.info()->user_data == 7 && world.stats()->ticks == 120);
    HOLDS(world.stats_text()->find("ticks        120\n") != std::string::npos);
    HOLDS(*world.state_hash() != 0 && world.validate()->empty());
}

static void joints_and_shapes()
{
    dcd::World world = make_world();
    dcd::BodyDef def;
    def.shape = *world.shape_capsule(0.5f, 0.25f);
    def.body_type = DCD_FIXED;
    dcd::JointDef joint;
    joint.a = *world.body_create(def);
    def.body_type = DCD_DYNAMIC;
    def.pose.p[0] = 2.0;
    joint.b = *world.body_create(def);
    joint.joint_type = DCD_JOINT_SPHERICAL;
    joint.frame_b.p[0] = -2.0f;
    {
        dcd::Owned<dcd::JointId> tie(world, *world.joint_create(joint));
        for (int i = 0; i < 30; i++) {
            HOLDS(world.step());
        }
        const dcd::Pose pose = world.body_get(joint.b)->pose;
        HOLDS(std::fabs(std::hypot(pose.p[0], pose.p[1], pose.p[2]) - 2.0) < 0.02);
        dcd::JointMotor motor;
        motor.velocity = 1.0f;
        motor.damping = 10.0f;
        HOLDS(world.joint_set_motor(tie, DCD_AXIS_TURN_Z, motor));
        HOLDS(world.joint_get_motor(tie, DCD_AXIS_TURN_Z)->damping == 10.0f);
        HOLDS(world.joint_set_motor(tie, DCD_AXIS_TURN_Z, nullptr));
        HOLDS(world.joint_get_motor(tie, DCD_AXIS_TURN_Z)->damping == 0.0f);
        HOLDS(world.joint_set_limit(tie, DCD_AXIS_TURN_Z, -1.0f, 1.0f));
        HOLDS(world.joint_get_limit(tie, DCD_AXIS_TURN_Z)->at(1) == 1.0f);
        HOLDS(world.joint_set_limit(tie, DCD_AXIS_TURN_Z, nullptr));
        HOLDS(std::isinf(world.joint_get_limit(tie, DCD_AXIS_TURN_Z)->at(1)));
    }
    HOLDS(world.joint_destroy(dcd::JointId{ 1 }).code() == DCD_ERR_STALE_ID);
    for (int i = 0; i < 60; i++) {
        HOLDS(world.step());
    }
    HOLDS(world.body_get(joint.b)->pose.p[1] < -3.0);

    const dcd::Vec3 corners[] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    const std::array<std::uint32_t, 3> triangles[] = { { 0, 2, 1 }, { 0, 1, 3 } };
    const float heights[6] = { 0, 0, 0, 1, 1, 1 };
    const dcd::ShapeId parts[] = { *world.shape_cylinder(1.0f, 0.5f), *world.shape_cone(1.0f, 0.5f) };
    const dcd::Frame frames[] = { { { 0, 0, 0 }, { 0, 0, 0, 1 } }, { { 0, 2, 0 }, { 0, 0, 0, 1 } } };
    HOLDS(world.shape_hull(corners));
    HOLDS(world.shape_mesh(corners, triangles));
    HOLDS(world.shape_heightfield(heights, 3, 2, { 10.0f, 1.0f, 10.0f }));
    HOLDS(world.shape_heightfield(heights, 3, 3, { 10.0f, 1.0f, 10.0f }).status().code() == DCD_ERR_ARGUMENT);
    HOLDS(world.shape_compound(parts, frames));
    const float twice[] = { 2.0f, 2.0f, 2.0f };
    HOLDS(world.shape_scale(parts[0], twice));
    HOLDS(world.shape_half_space({ 0.0f, 1.0f, 0.0f }) && world.shape_segment(corners[0], corners[1]));
    HOLDS(world.shape_info(*world.shape_round(parts[0], 0.25f))->border == 0.25f);
    HOLDS(world.shape_compound(parts, dcd::Span<const dcd::Frame>(frames, 1)).status().code() == DCD_ERR_ARGUMENT);
    HOLDS(!world.shape_hull({}));
}

static void handles_clean_up()
{
    DcdWorld handle;
    dcd::Owned<dcd::BodyId> late;
    {
        dcd::World world = make_world();
        dcd::BodyDef def;
        dcd::Owned<dcd::ShapeId> shape(world, *world.shape_sphere(1.0f));
        def.shape = shape;
        handle = world.handle();
        dcd::BodyId gone;
        {
            dcd::Owned<dcd::BodyId> body(world, *world.body_create(def));
            dcd::Owned<dcd::BodyId> other(std::move(body));
            HOLDS(body.id() == dcd::BodyId{ 0 } && world.body_is_valid(other));
            gone = other;
        }
        HOLDS(!world.body_is_valid(gone));
        late = dcd::Owned<dcd::BodyId>(world, *world.body_create(def));
        HOLDS(late.id() != gone && gone < late.id());

        dcd::World moved(std::move(world));
        HOLDS(world.handle().v == 0 && moved.is_valid());
        moved = std::move(moved);
        dcd::World another = make_world();
        const DcdWorld replaced = another.handle();
        another = std::move(moved);
        HOLDS(!dcd_world_is_valid(replaced) && another.handle().v == handle.v);
        HOLDS(another.body_is_valid(late));
    }
    HOLDS(!dcd_world_is_valid(handle));

    dcd::World world = make_world();
    dcd::World taken(world.release());
    HOLDS(!world.is_valid() && taken.is_valid());
    taken.reset();
    HOLDS(!taken.is_valid());
}

static void failures_say_why()
{
    HOLDS(dcd::version_check() && dcd::version() == DCD_VERSION && std::strlen(dcd::version_string()) >= 5);
    dcd::World none;
    const dcd::Status status = none.step();
    HOLDS(!status && status.code() == DCD_ERR_NULL && std::strcmp(status.name(), "DCD_ERR_NULL") == 0);
    HOLDS(dcd::last_error().find("dcd_step: ") == 0);

    dcd::WorldDef def;
    def.regions = 1000;
    const dcd::Result<dcd::World> world = dcd::World::create(def);
    HOLDS(!world && world.status().code() == DCD_ERR_ARGUMENT);
    /* Another failed call does not change the message of the first. */
    HOLDS(!none.step() && dcd::last_error() == status.message());
    HOLDS(world.status().message().find("dcd_world_create: ") == 0 && world.status().message() != status.message());
    HOLDS(dcd::World::open_scene("no such scene").status().code() == DCD_ERR_ARGUMENT);
    const char *params[] = { "n=20" };
    HOLDS(dcd::World::open_scene("pile", params)->body_at(20));
    HOLDS(dcd::World::client_connect({}).status().code() == DCD_ERR_NULL);
    HOLDS(dcd::World::participant_join({}).status().code() == DCD_ERR_NULL);
    HOLDS(!none.stats_text() && !none.regions() && !none.own_avatars());
    HOLDS(!none.connections() && !none.connection_info({ 1 }) && !none.disconnect({ 1 }) && !none.poll(0));
    const unsigned char bytes[2] = { 1, 2 };
    HOLDS(!none.send({ 1 }, bytes) && !none.send({ 1 }, std::vector<unsigned char>{ 1 }));
    HOLDS(!none.send({ 1 }, "hello") && !none.send({ 1 }, std::string("hello"), DCD_SEND_UNRELIABLE));
    HOLDS(dcd::pose_interpolate({ { 0, 0, 0 }, { 0, 0, 0, 1 } }, { { 2, 0, 0 }, { 0, 0, 0, 1 } }, 0.5)->p[0] == 1.0);
    HOLDS(none.body_get({ 0 }).value_or({ { { 4, 0, 0 }, { 0, 0, 0, 1 } }, {} }).pose.p[0] == 4.0);
}

static void what_is_set_counts()
{
    dcd::World world = make_world();
    const dcd::BodyId ground = add_floor(world);
    dcd::BodyDef def;
    def.shape = *world.shape_sphere(0.5f);
    def.pose.p[1] = 10.0;
    const dcd::BodyId body = *world.body_create(def);
    const float weight = 9.81f * world.body_info(body)->mass;
    HOLDS(world.body_set_force(body, { 0.0f, weight, 0.0f }));
    HOLDS(world.body_apply_torque_impulse(body, { 0.0f, 100.0f, 0.0f }));
    HOLDS(world.body_apply_impulse(body, { 0.0f, 0.0f, 0.0f }, { 0.0, 10.0, 0.0 }));
    HOLDS(world.body_set_events(body, DCD_EVENT_CONTACT, 0.0f));
    HOLDS(world.body_set_material(ground, 0.1f, 0.0f) && world.body_set_groups(body, 1, 0xFFFFFFFFu));
    for (int i = 0; i < 60; i++) {
        HOLDS(world.step());
    }
    HOLDS(std::fabs(world.body_get(body)->pose.p[1] - 10.0) < 0.01);
    HOLDS(world.body_get(body)->velocity.angular[1] > 0.1f);
    dcd::Motion motion = *world.body_get(body);
    motion.pose.p[1] = 3.0;
    motion.velocity.linear[0] = 1.0f;
    HOLDS(world.body_set_pose(body, motion.pose) && world.body_set_velocity(body, motion.velocity));
    HOLDS(world.body_get(body)->pose.p[1] == 3.0 && world.body_get(body)->velocity.linear[0] == 1.0f);
    HOLDS(world.body_sleep(body) && world.body_info(body)->sleeping);
    HOLDS(world.body_wake(body) && !world.body_info(body)->sleeping);
    def.body_type = DCD_KINEMATIC_POSE;
    def.pose.p[0] = 5.0;
    const dcd::BodyId lift = *world.body_create(def), both[] = { lift, { 99 } };
    dcd::Pose targets[] = { def.pose, def.pose };
    targets[0].p[1] = 10.5;
    DcdStatus each[2] = { 1, 1 };
    HOLDS(world.state_write_targets(both, targets, 0, each) && each[0] == DCD_OK && each[1] == DCD_ERR_STALE_ID);
    HOLDS(world.state_write_targets(both, targets).code() == DCD_ERR_STALE_ID);
    HOLDS(world.step() && std::fabs(world.body_get(lift)->pose.p[1] - 10.5) < 1e-5);
    HOLDS(world.state_read(both, targets, 0, each) && each[1] == DCD_ERR_STALE_ID && targets[0].p[1] > 10.4);
    HOLDS(world.shape_destroy(def.shape) && world.body_destroy(ground));
    const dcd::BodyId rest[] = { body };
    HOLDS(world.bodies_destroy(rest) && !world.body_is_valid(body));
}

/* What a query finds exists, even while another thread creates and destroys bodies. */
static void what_is_found_is_no_null_entry()
{
    dcd::World world = make_world();
    add_floor(world);
    dcd::BodyDef def;
    def.shape = *world.shape_sphere(0.5f);
    std::atomic<bool> over{ false };
    std::thread other([&] {
        while (!over) {
            world.body_destroy(*world.body_create(def)).expect();
        }
    });
    dcd::BoxQuery around;
    around.min[0] = around.min[1] = around.min[2] = -100.0;
    around.max[0] = around.max[1] = around.max[2] = 100.0;
    const dcd::BoxQuery boxes[] = { around };
    std::size_t seen = 0, nulls = 0;
    for (int i = 0; i < 4000; i++) {
        const dcd::Found<dcd::Overlap> found = *world.overlap_boxes(boxes);
        for (const dcd::Overlap &overlap : found.items) {
            seen++;
            nulls += overlap.body.v == 0;
        }
    }
    over = true;
    other.join();
    HOLDS(seen >= 4000 && nulls == 0);
}

/* A handle that is reset where nothing can be destroyed is kept. */
static void what_cannot_be_destroyed_yet_is_kept()
{
    dcd::World world = make_world(), other = make_world();
    dcd::BodyDef def;
    def.shape = *world.shape_sphere(0.5f);
    dcd::Owned<dcd::BodyId> ball(world, *world.body_create(def));
    const dcd::BodyId id = ball.id();
    dcd::BoxQuery around;
    around.min[0] = around.min[1] = around.min[2] = -1e9;
    around.max[0] = around.max[1] = around.max[2] = 1e9;
    const auto note = [&](const dcd::Overlap &) { return other.reset(), ball.reset(), false; };
    world.overlap_box_each(around, note).expect();
    HOLDS(other.handle().v != 0 && ball.id().v == id.v);
    HOLDS(other.step());
    other.reset();
    ball.reset();
    HOLDS(other.handle().v == 0 && ball.id().v == 0 && !world.body_is_valid(id));
}

/* Bodies and their colliders are changed after they were made. */
static void bodies_are_changed()
{
    dcd::World world = make_world();
    dcd::BodyDef def;
    def.shape = *world.shape_box({ 0.5f, 0.5f, 0.5f });
    def.pose.p[1] = 10.0;
    const dcd::BodyId box = *world.body_create(def);
    const float half = 0.5f * 9.81f * world.body_info(box)->mass;
    HOLDS(world.body_add_force(box, { 0.0f, half, 0.0f }) && world.body_add_force(box, { 0.0f, half, 0.0f }, { 1.0, 10.0, 0.0 }));
    const dcd::BodyInfo pushed = *world.body_info(box);
    HOLDS(std::fabs(pushed.force[1] - 2.0f * half) < 1.0f && std::fabs(pushed.torque[2] - half) < 1.0f);
    dcd::BodyProperties properties = *world.body_properties(box);
    HOLDS(properties.gravity_scale == 1.0f);
    properties.gravity_scale = 0.5f;
    HOLDS(world.body_set_properties(box, properties) && world.body_properties(box)->gravity_scale == 0.5f);

    const std::uint32_t knob = *world.collider_add(box, *world.shape_sphere(0.25f));
    HOLDS(knob == 1 && world.body_info(box)->colliders == 2);
    dcd::ColliderProperties surface = *world.collider_properties(box, knob);
    surface.friction = 0.25f;
    HOLDS(world.collider_set_properties(box, knob, surface) && world.collider_properties(box, knob)->friction == 0.25f);
    HOLDS(world.collider_set_shape(box, knob, *world.shape_sphere(0.375f)));
    HOLDS(world.shape_info(*world.collider_shape(box, knob))->size[0] == 0.375f);
    HOLDS(world.collider_remove(box, knob) && world.body_info(box)->colliders == 1);

    def.body_type = DCD_KINEMATIC_POSE;
    def.pose.p[0] = 5.0;
    const dcd::BodyId lift = *world.body_create(def);
    dcd::Pose up = def.pose;
    up.p[1] = 10.5;
    HOLDS(world.body_set_target(lift, up) && world.step() && std::fabs(world.body_get(lift)->pose.p[1] - 10.5) < 1e-5);

    dcd::ShapeQuery place;
    place.shape = def.shape;
    place.pose = up;
    dcd::PointQuery point;
    point.point[0] = 5.0;
    point.point[1] = 10.5;
    const dcd::ShapeQuery places[] = { place };
    const dcd::PointQuery points[] = { point };
    HOLDS(world.overlap_shapes(places)->items.at(0).body == lift);
    HOLDS((*world.query_poll_overlaps(*world.overlap_shapes_submit(places), 1))->items.at(0).body == lift);
    HOLDS((*world.query_poll_overlaps(*world.overlap_points_submit(points), 1))->items.at(0).body == lift);
}

static void joints_are_looked_at_and_changed()
{
    dcd::World world = make_world();
    dcd::BodyDef def;
    def.shape = *world.shape_sphere(0.25f);
    def.body_type = DCD_FIXED;
    dcd::JointDef tie;
    tie.a = *world.body_create(def);
    def.body_type = DCD_DYNAMIC;
    def.pose.p[1] = -1.0;
    tie.b = *world.body_create(def);
    tie.joint_type = DCD_JOINT_SPHERICAL;
    tie.frame_b.p[1] = 1.0f;
    const dcd::JointId joint = *world.joint_create(tie);
    HOLDS(world.joint_is_valid(joint) && world.body_joints(tie.b)->at(0) == joint);
    dcd::Frame arm = tie.frame_b;
    arm.p[1] = 2.0f;
    HOLDS(world.joint_set_frames(joint, tie.frame_a, arm) && world.joint_set_softness(joint, 50.0f, 2.0f));
    HOLDS(world.joint_set_flags(joint, DCD_JOINT_COLLIDE));
    const dcd::JointInfo info = *world.joint_info(joint);
    HOLDS(info.a == tie.a && info.b == tie.b && info.frame_b.p[1] == 2.0f && info.flags == DCD_JOINT_COLLIDE);
    arm.p[1] = 3.0f;
    HOLDS(world.joint_set_frames(joint, nullptr, arm) && world.joint_info(joint)->frame_b.p[1] == 3.0f);
    HOLDS(world.joint_info(joint)->frame_a.p[1] == info.frame_a.p[1]);
    arm.p[1] = 0.5f;
    HOLDS(world.joint_set_frames(joint, arm, nullptr) && world.joint_info(joint)->frame_a.p[1] == 0.5f);
    HOLDS(world.joint_info(joint)->frame_b.p[1] == 3.0f && world.joint_set_frames(joint, tie.frame_a, info.frame_b));
    HOLDS(info.natural_frequency == 50.0f && info.damping_ratio == 2.0f);
    HOLDS(world.joint_set_strength(joint, 0.0f, 0.0f) && world.step());
    HOLDS(world.events()->overloads().size() == 1 && world.events()->overloads()[0].joint == joint);
    HOLDS(world.joint_destroy(joint) && !world.joint_is_valid(joint));
}

/* A character walks, a car drives, and both are shown between steps. */
static void a_person_and_a_car_set_off()
{
    dcd::World world = make_world();
    const dcd::BodyId floor = add_floor(world);
    dcd::BodyDef def;
    def.shape = *world.shape_capsule(0.5f, 0.3f);
    def.body_type = DCD_KINEMATIC;
    def.pose.p[1] = 0.85;
    const dcd::BodyId person = *world.character_create(def, {});
    HOLDS(world.body_set_velocity(person, { { 2.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }));

    std::array<dcd::Wheel, 4> wheels;
    for (std::size_t i = 0; i < wheels.size(); i++) {
        wheels[i].at[0] = i < 2 ? 1.2f : -1.2f;
        wheels[i].at[1] = -0.2f;
        wheels[i].at[2] = i % 2 == 0 ? 0.8f : -0.8f;
        wheels[i].engine_force = 2000.0f;
    }
    dcd::VehicleDef car;
    car.wheels = wheels.data();
    car.wheel_count = 4;
    def.shape = *world.shape_box({ 1.6f, 0.4f, 0.8f });
    def.body_type = DCD_DYNAMIC;
    def.density = 250.0f;
    def.pose.p[1] = 1.2;
    def.pose.p[2] = 10.0;
    const dcd::BodyId chassis = *world.vehicle_create(def, car);
    HOLDS(world.vehicle_drive(chassis, { 1.0f, 0.0f, 0.0f }) && world.view_time());
    for (int i = 0; i < 60; i++) {
        HOLDS(world.step());
    }
    const double walked = world.body_get(person)->pose.p[0];
    HOLDS(std::fabs(walked - 2.0) < 0.2 && world.body_get(chassis)->pose.p[0] > 0.5);
    const dcd::CharacterState stance = *world.character_state(person);
    HOLDS(stance.grounded && !stance.sliding && stance.ground.body == floor);
    HOLDS(world.character_state(chassis).status().code() == DCD_ERR_ARGUMENT);
    const std::vector<dcd::WheelState> stands = *world.vehicle_wheels(chassis);
    HOLDS(stands.size() == 4 && stands[0].ground.body == floor && stands[0].spin > 0.0f && stands[3].rolled != 0.0f);
    HOLDS(world.vehicle_wheels(person).status().code() == DCD_ERR_ARGUMENT);

    dcd::ViewTime time = *world.view_time();
    time.shown = time.predicted = 59.5;
    const double shown = world.view_body(person, time.shown)->p[0];
    HOLDS(shown > walked - 0.03 && shown < walked);
    HOLDS(world.view_state(time)->size() == 2);
    HOLDS(world.prediction_set(true) && world.prediction()->bodies == 0);
}

/* Written files are read again. */
static void files_are_written(const std::string &folder)
{
    dcd::World world = make_world();
    dcd::BodyDef def;
    def.shape = *world.shape_sphere(0.5f);
    const dcd::BodyId ball = *world.body_create(def);
    HOLDS(world.record((folder + "/whole.dcdr").c_str()) && world.step() && world.record_stop());
    HOLDS(world.record_last(60.0f) && world.step() && world.record_keep((folder + "/last.dcdr").c_str()));
    const std::string saved = folder + "/saved.dcd";
    const std::uint64_t then = *world.state_hash();
    HOLDS(world.snapshot_save_file(saved.c_str()) && world.body_destroy(ball) && *world.state_hash() != then);
    HOLDS(world.snapshot_load_file(saved.c_str()) && *world.state_hash() == then);
    HOLDS(world.gltf_save_file((folder + "/drawn.glb").c_str()));
    for (const char *name : { "/whole.dcdr", "/last.dcdr", "/drawn.glb" }) {
        std::FILE *file = std::fopen((folder + name).c_str(), "rb");
        HOLDS(file != nullptr && std::fgetc(file) != EOF);
        if (file != nullptr) {
            std::fclose(file);
        }
    }
}

static void a_world_is_served(const std::string &folder)
{
    const dcd::World local = make_world();
    const std::string data = folder + "/served";
    dcd::ServerDef def;
    def.source = local.handle();
    def.data_path = data.c_str();
    dcd::World server = *dcd::World::server_create(def);
    const std::string address = *server.address(), token = *server.token_create(DCD_ROLE_NODE, 60);
    HOLDS(token.find("dcd1-") == 0);
    dcd::NodeDef node;
    node.server = address.c_str();
    node.token = token.c_str();
    node.threads = 1;
    const dcd::Result<dcd::World> joined = dcd::World::node_join(node);
    HOLDS(joined && joined->info()->role == DCD_ROLE_NODE);
    HOLDS(server.server_suspend() && server.step().code() != DCD_OK);
}

/* Destroyed after main, when the thread's own data are gone. */
static dcd::World level;
static dcd::Owned<dcd::BodyId> player;

static void static_objects_go_at_the_end()
{
    level = make_world();
    dcd::BodyDef def;
    def.shape = *level.shape_sphere(0.5f);
    player = dcd::Owned<dcd::BodyId>(level, *level.body_create(def));
    HOLDS(dcd::bug_set([](void *, const char *, const char *, std::uint32_t) { std::_Exit(3); }, nullptr));
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        return 2;
    }
    HOLDS(dcd::log_set(nullptr, nullptr, DCD_LOG_OFF));
    effects_are_seen();
    a_ball_breaks_a_tower();
    joints_and_shapes();
    handles_clean_up();
    failures_say_why();
    what_is_set_counts();
    bodies_are_changed();
    joints_are_looked_at_and_changed();
    a_person_and_a_car_set_off();
    files_are_written(argv[1]);
    a_world_is_served(argv[1]);
    what_is_found_is_no_null_entry();
    what_cannot_be_destroyed_yet_is_kept();
    static_objects_go_at_the_end();
    failures += throwing_failures();
    std::printf("%d checks, %d failures\n", checks, failures);
    return failures == 0 ? 0 : 1;
}
