/* dcd: one rigid-body world, computed by many Rapier worlds.
 *
 * Calls. Every function returns a DcdStatus, DCD_OK or a negative code, and writes its outputs only on success. The few functions that
 * differ say so. dcd_last_error() gives the message of the calling thread's last failure: function, cause, remedy.
 *
 * Handles. Worlds, bodies, shapes, joints and connections are opaque numbers in a struct; { 0 } is null. A null handle gives
 * DCD_ERR_NULL. A handle whose thing is gone, or that belongs to another world, gives DCD_ERR_STALE_ID. DcdBodyId names the cases in
 * which an id is given again.
 *
 * Roles. A world is local, a client's, a builder's, a participant's, a server's or a node's. The functions are the same for all roles.
 * What a role cannot do gives DCD_ERR_UNSUPPORTED; the message says what to use instead. "Who can do what" in examples-c/README.md is
 * a table of it.
 *
 * Structs. Structs that begin with struct_size may grow in later versions. Start from their _INIT macro:
 *
 *     DcdBodyDef def = DCD_BODY_DEF_INIT;
 *
 * Members named reserved are 0. Values outside their range give DCD_ERR_ARGUMENT.
 *
 * Pointers. A function reads what its pointers lead to during the call, and keeps none of them, except those of dcd_log_set,
 * dcd_bug_set, dcd_hooks_set, dcd_tasks_set and dcd_allocator_set. Pointers must be aligned for their type. A function that lends
 * memory says how long this lives. Texts are UTF-8 that ends with NUL.
 *
 * Threads. Any thread may call any function at any time. Calls on different worlds run side by side. Calls on one world run one after
 * the other, and a call waits for its turn. But queries (dcd_cast_rays, dcd_overlap_shapes and the like) and functions that only read
 * (dcd_body_get, dcd_state_read, dcd_stats and the like) run beside each other. From within a function that the library calls (those
 * of dcd_log_set, dcd_bug_set, dcd_debug_draw, dcd_hooks_set, dcd_tasks_set, queries) every call on a world gives DCD_ERR_BUSY.
 *
 * Bugs of the library. A panic inside the library becomes DCD_ERR_PANIC, and dcd_bug_set tells where. The world in which it happened
 * answers every later call so, and can be destroyed. Everything else goes on.
 *
 * Units. Metres, kilograms, seconds, newtons, radians. Positions in world space are double, all else is float. Vectors are x, y, z;
 * y is up by default. Quaternions are x, y, z, w.
 */
#ifndef DCD_H
#define DCD_H


/* Generated from dcd-ffi by cbindgen; write it anew with: UPDATE=1 cargo test -p dcd-ffi --test header */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Define DCD_SHARED on Windows when linking to the shared library. */
#if defined(_WIN32) && defined(DCD_SHARED)
#define DCD_API __declspec(dllimport)
#else
#define DCD_API
#endif

/* The version of this header; compare with dcd_version() by dcd_version_check(). */
#define DCD_VERSION_MAJOR 0u
#define DCD_VERSION_MINOR 1u
#define DCD_VERSION_PATCH 0u
#define DCD_VERSION (DCD_VERSION_MAJOR * 1000000u + DCD_VERSION_MINOR * 1000u + DCD_VERSION_PATCH)

// Largest number of items in one bulk call.
#define DCD_MAX_ITEMS 16777216

// Largest magnitude of a number given as a float, where its function does not say otherwise. Larger numbers would not stay finite
// in single precision.
#define DCD_MAX_NUMBER 1.0e6

// Largest magnitude of a coordinate in world space, metres.
#define DCD_MAX_COORDINATE 1.0e9

// In DcdBodyDef.flags: the body does not jump through moving bodies either (continuous collision detection), at some cost. No body
// jumps through fixed ones.
#define DCD_BODY_CCD 1

// In DcdBodyDef.flags: the body is a sensor, which detects and does not push.
#define DCD_BODY_SENSOR 2

// In DcdBodyDef.flags: the body does not fall asleep by itself. Its thresholds of sleep are kept for when the flag is taken away.
#define DCD_BODY_NO_SLEEP 4

// In DcdBodyDef.flags: the body sleeps at first, until something wakes it.
#define DCD_BODY_ASLEEP 8

// In DcdBodyDef.flags: the body is not there until dcd_body_set_properties takes this flag away. It keeps its place, and its
// joints wait.
#define DCD_BODY_DISABLED 16

// In DcdBodyDef.flags: the body may turn by more than a quarter turn per step, as wheels and propellers do.
#define DCD_BODY_FAST_SPIN 32

// In DcdBodyDef.flags: the body's own inertia does not change its spin, as it does that of a thrown book.
#define DCD_BODY_NO_GYRO 64

// In DcdBodyDef.flags: two bodies that both have this flag collide when groups and mask match one way. All others must match both
// ways.
#define DCD_BODY_ANY_GROUP 128

// In DcdBodyDef.events: dcd_events reports contacts of the body that begin and end.
#define DCD_EVENT_CONTACT 1

// In DcdBodyDef.events: dcd_events reports contacts of the body that press harder than force_threshold.
#define DCD_EVENT_FORCE 2

// In DcdBodyDef.locked: no movement along x.
#define DCD_LOCK_X 1

// In DcdBodyDef.locked: no movement along y.
#define DCD_LOCK_Y 2

// In DcdBodyDef.locked: no movement along z.
#define DCD_LOCK_Z 4

// In DcdBodyDef.locked: no turning about x.
#define DCD_LOCK_TURN_X 8

// In DcdBodyDef.locked: no turning about y.
#define DCD_LOCK_TURN_Y 16

// In DcdBodyDef.locked: no turning about z.
#define DCD_LOCK_TURN_Z 32

// DcdBodyInfo.region of a fixed body, which has no owner.
#define DCD_NO_REGION UINT32_MAX

// In DcdWorldDef.axes: planes across x may cut the world into regions. In DcdCut.axis: the plane lies across x.
#define DCD_CUT_X 1

// In DcdWorldDef.axes: planes across y may cut the world into regions. In DcdCut.axis: the plane lies across y.
#define DCD_CUT_Y 2

// In DcdWorldDef.axes: planes across z may cut the world into regions. In DcdCut.axis: the plane lies across z.
#define DCD_CUT_Z 4

// In DcdServerDef.flags: the server begins anew, and forgets a world that the data folder holds.
#define DCD_SERVER_FRESH 1

// In DcdServerDef.flags: the world advances as fast as the nodes can, rather than in real time.
#define DCD_SERVER_UNPACED 2

// Least size of a shape, metres. A smaller shape has no mass to speak of in single precision.
#define DCD_MIN_SIZE 1.0e-4

// Stands for all colliders of a body, in place of a collider's number.
#define DCD_ALL_COLLIDERS UINT32_MAX

// Largest number of colliders of one body.
#define DCD_MAX_COLLIDERS 4096

// In DcdBodyDef.pairs: a dynamic body meets dynamic ones.
#define DCD_PAIR_DYNAMIC_DYNAMIC 1

// In DcdBodyDef.pairs: a dynamic body meets kinematic ones, and the other way round.
#define DCD_PAIR_DYNAMIC_KINEMATIC 2

// In DcdBodyDef.pairs: a dynamic body meets fixed ones, and the other way round.
#define DCD_PAIR_DYNAMIC_FIXED 4

// In DcdBodyDef.pairs: a kinematic body meets kinematic ones.
#define DCD_PAIR_KINEMATIC_KINEMATIC 8

// In DcdBodyDef.pairs: a kinematic body meets fixed ones, and the other way round, such as a fixed sensor that notices doors and
// players.
#define DCD_PAIR_KINEMATIC_FIXED 16

// In DcdBodyDef.pairs: a fixed body meets fixed ones.
#define DCD_PAIR_FIXED_FIXED 32

// In DcdColliderProperties.flags: the collider is a sensor, which detects and does not push.
#define DCD_COLLIDER_SENSOR 1

// In DcdColliderProperties.flags: the collider is not there until this flag is taken away.
#define DCD_COLLIDER_DISABLED 2

// In DcdColliderProperties.flags: two colliders that both have this flag collide when groups and mask match one way. All others
// must match both ways.
#define DCD_COLLIDER_ANY_GROUP 4

// In DcdJointDef.flags: `limit` counts. In DcdJointInfo.flags: the joint has some limit.
#define DCD_JOINT_LIMIT 1

// In DcdJointDef.flags: `motor` runs. In DcdJointInfo.flags: the joint has some motor.
#define DCD_JOINT_MOTOR 2

// In DcdJointDef.flags: the two bodies collide with one another too.
#define DCD_JOINT_COLLIDE 4

// In DcdJointDef.flags: the joint does nothing until dcd_joint_set_flags takes this flag away.
#define DCD_JOINT_DISABLED 8

// Timeout of dcd_step_wait that waits until the step is done, however long it takes.
#define DCD_FOREVER UINT64_MAX

// In DcdStateView.flags: the body sleeps.
#define DCD_STATE_SLEEPING 1

// In DcdStateView.flags: this process's interest does not reach the body (dcd_interest_set). The state is that last heard of.
#define DCD_STATE_OUTSIDE 2

// Largest size of a reason, bytes, NUL included.
#define DCD_MAX_REASON 256

// In the flags of dcd_send and DcdMessage.flags: the message is a datagram, which may be lost or overtaken.
#define DCD_SEND_UNRELIABLE 1

// Largest size of a message, bytes.
#define DCD_MAX_MESSAGE 32768

// Largest size of a message with DCD_SEND_UNRELIABLE, bytes.
#define DCD_MAX_DATAGRAM 1024

// In DcdContact.kind: the two bodies began to touch.
#define DCD_CONTACT_BEGAN 0

// In DcdContact.kind: the two bodies ceased to touch.
#define DCD_CONTACT_ENDED 1

// In DcdContact.flags: one of the two colliders is a sensor.
#define DCD_CONTACT_SENSOR 1

// In DcdBodyChange.kind: a body came into a served world.
#define DCD_CHANGE_APPEARED 1

// In DcdBodyChange.kind: a body of a served world is gone, and its id is stale.
#define DCD_CHANGE_REMOVED 2

// In DcdBodyChange.kind: what was asked of an avatar, or built, is refused. If the body had not appeared yet, it never will, and
// its id is stale.
#define DCD_CHANGE_REFUSED 3

// In DcdBodyChange.reason: the program speaks another version of the protocol than the server.
#define DCD_REFUSED_VERSION 1

// In DcdBodyChange.reason: the body is not an avatar of this process.
#define DCD_REFUSED_NOT_YOURS 2

// In DcdBodyChange.reason: the avatar is not in the world.
#define DCD_REFUSED_UNKNOWN 3

// In DcdBodyChange.reason: an avatar with this id waits for its return. Make another.
#define DCD_REFUSED_EXISTS 4

// In DcdBodyChange.reason: the velocity is above the limit that the server sets, or the spin is above a quarter of a turn per
// tick.
#define DCD_REFUSED_TOO_FAST 5

// In DcdBodyChange.reason: a newer input had arrived before.
#define DCD_REFUSED_LATE 6

// In DcdBodyChange.reason: the shape did not arrive with the avatar, or cannot be an avatar's. For a builder: the shape cannot be
// a builder's, which has neither voxels nor half-spaces.
#define DCD_REFUSED_SHAPE 7

// In DcdBodyChange.reason: the client wants too many avatars or too much of them.
// - It has 1,024 avatars, or has brought 2,048 at once and 128 more each second, those that it destroyed included.
// - It has asked too much of them at a time.
// - It has brought more than 1 MiB of new shapes that are not forgotten yet: use the shapes that there are.
// - For a builder: more than 4,096 bodies or joints of its own, more than 24,576 changes at once and 1,024 more each second, or
//   more than 16 MiB of such shapes.
#define DCD_REFUSED_TOO_MANY 8

// In DcdBodyChange.reason: the body would cost too much.
// - An avatar has more than 8 extra solver or PGS iterations, reaches farther than 100 m from its origin, or begins where 64
//   others of this client are. Or all avatars of the client together have more than 20,000 corners.
// - For a client's characters and vehicles see dcd_character_create and dcd_vehicle_create.
// - A body that is built takes more than 60 KiB with its shapes and what joints tie to it, asks for contacts of fixed bodies,
//   begins among more than 1,024 colliders, or looks farther than 10 m around (contact_skin, soft_ccd). Or all that the builder
//   has built has more than 200,000 corners or 16,384 colliders.
#define DCD_REFUSED_COSTLY 9

// In DcdBodyChange.reason: the jump is farther than the avatar could have moved since its last one, or in a second, at the limit
// of speed that the server sets.
#define DCD_REFUSED_TOO_FAR 10

// In DcdBodyChange.reason: the client may not build, because its token was for another role than DCD_ROLE_BUILDER.
#define DCD_REFUSED_MAY_NOT_BUILD 11

// In DcdBodyChange.reason: a builder may not do that. It leaves avatars, the kind of fixed bodies, and shapes as they are.
#define DCD_REFUSED_NOT_TO_BE_BUILT 12

// In DcdEventView.flags: the link to the server is gone. dcd_step says why.
#define DCD_EVENTS_DISCONNECTED 1

// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.filter is asked about contacts of the collider.
#define DCD_HOOK_FILTER 1

// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.detect is asked about what the collider detects as a sensor, or is
// detected by.
#define DCD_HOOK_DETECT 2

// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.modify is asked about contacts of the collider before they are
// solved.
#define DCD_HOOK_MODIFY 4

// In DcdFilter.flags: the queries overlook fixed bodies.
#define DCD_FILTER_NO_FIXED 1

// In DcdFilter.flags: the queries overlook kinematic bodies.
#define DCD_FILTER_NO_KINEMATIC 2

// In DcdFilter.flags: the queries overlook dynamic bodies.
#define DCD_FILTER_NO_DYNAMIC 4

// In DcdFilter.flags: the queries overlook sensors.
#define DCD_FILTER_NO_SENSORS 8

// In DcdFilter.flags: the queries overlook all but sensors.
#define DCD_FILTER_NO_SOLIDS 16

// In the flags of DcdRay and DcdPointQuery: bodies are hollow. A ray that starts inside a body meets its surface from within. The
// place nearest to a point inside a body is on its surface.
#define DCD_QUERY_HOLLOW 1

// In DcdShapeCast.flags: what the shape overlaps at the start stops it only if it moves farther in.
#define DCD_QUERY_LEAVE 2

// In the flags of DcdShapeHit and DcdPointHit: the hit began there. The shape overlaps the body at the start, or the point lies
// inside the body.
#define DCD_HIT_INSIDE 1

// Largest cost of one submission, and largest number of bodies of its filter. A ray costs 1, a shape that is cast or overlaps
// DCD_SHAPE_COST, a point or a box 1. Overlaps that are submitted together cost DCD_OVERLAPS_COST at least.
#define DCD_MAX_SUBMITTED_COST 1024

// Cost of a submitted shape.
#define DCD_SHAPE_COST 8

// Least cost of overlaps that are submitted together.
#define DCD_OVERLAPS_COST 64

// Largest number of queries that a world may have open: submitted, and neither fetched nor cancelled.
#define DCD_MAX_OPEN_QUERIES 64

// Largest cost of all open queries of a world together.
#define DCD_MAX_OPEN_COST 4096

// Largest number of bodies that the overlaps of one submission may find.
#define DCD_MAX_SUBMITTED_OVERLAPS 4096

// Longest turn of a submitted cast, radians.
#define DCD_MAX_SUBMITTED_TURN 64.0

// Largest size of a shape that a submitted cast turns, and of the distance of its farthest point from its origin, metres.
#define DCD_MAX_TURNING_SIZE 100.0

// Number of the node of a region or an owner where there is none.
#define DCD_NO_NODE UINT32_MAX

// In DcdOwner.flags: this process computes the region that owns the body.
#define DCD_OWNER_HERE 1

// In DcdOwner.flags: nobody has told yet who owns the body, which may not have moved since this process joined. The region is the
// one that the body is in. That is its owner except for moments at borders, and while islands or joints tie the body to one in
// another region.
#define DCD_OWNER_BY_PLACE 4

// In DcdOwner.flags: what this world shows of the body was heard from others, and is some milliseconds old.
#define DCD_OWNER_HEARD 2

// Result of a call: DCD_OK, or one of the negative DCD_ERR_ codes. A code never changes its number.
typedef int32_t DcdStatus;

// Severity of a log line: DCD_LOG_OFF to DCD_LOG_TRACE.
typedef uint32_t DcdLogLevel;

// Receives a log line. `user` is the pointer given to dcd_log_set. `message` has `length` bytes of UTF-8 without a NUL at the end,
// valid during the call.
//
// Any thread may call the function, several threads at a time. It must return normally (no longjmp, no C++ exception). Calls on
// worlds from within it give DCD_ERR_BUSY.
typedef void (*DcdLogFn)(void *user, DcdLogLevel level, const char *message, size_t length);

// Receives a report of a bug: `message` says what does not hold, `file` and `line` where in the library's source. The texts are
// valid during the call.
typedef void (*DcdBugFn)(void *context, const char *message, const char *file, uint32_t line);

// Returns a block of `size` bytes, above 0, aligned to `alignment`, a power of two. Returns null if there is no memory, which ends
// the process.
typedef void *(*DcdAllocateFn)(void *context, size_t size, size_t alignment);

// Frees a block that DcdAllocateFn returned for this size and alignment.
typedef void (*DcdFreeFn)(void *context, void *block, size_t size, size_t alignment);

// Coupling: how regions come to consensus on the bodies that they share.
typedef uint32_t DcdCoupling;

// Accuracy that is asked of DCD_COUPLING_AUTO.
typedef uint32_t DcdPreset;

// Fidelity: how much of a world is computed in full. Regions that nobody looks at may be stepped once per two or four steps.
typedef uint32_t DcdFidelity;

// Plane that cuts a world into regions.
typedef struct DcdCut {
    // Position of the plane along its axis, metres.
    double at;
    // Axis across which the plane lies: DCD_CUT_X, DCD_CUT_Y or DCD_CUT_Z.
    uint32_t axis;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdCut;

// Definition of a local world. Start from DCD_WORLD_DEF_INIT.
//
// The world is cut into `regions` regions by halving. The largest part of the box from `min` to `max` is halved across its longest
// edge, until there are enough parts. The axis along which gravity pulls most is not cut, unless nothing else is left to halve: a
// level cut goes through all that lies on the ground. `axes` says otherwise, and `cuts` names the planes instead. dcd_regions lists
// the result.
//
// A cut costs least where nothing lies near it, so place the box around what moves, or the planes between what moves apart. Each
// region costs something all the same: a game of 2,000 bodies takes more processor time in four regions than in one (the manual's
// page on regions and couplings says how much).
typedef struct DcdWorldDef {
    // Size of this struct: sizeof(DcdWorldDef).
    uint32_t struct_size;
    // Number of threads that compute the world, however many regions it has, 1 to 1024; 0: one per core. With 1, the thread that
    // calls dcd_step computes, as it does anyhow while few bodies are awake. The result does not depend on it.
    uint32_t threads;
    // Number of regions that the world is cut into, 1 to 256; 0: as many as the scene asks for, else 1, and more only where the
    // bodies of a scene lie too far apart for the f32 of one region. One region is exact, and uses all threads.
    uint32_t regions;
    // Number of solver iterations per step, 1 to 1000. More iterations make tall stacks stiffer and cost time.
    uint32_t solver_iterations;
    // Gravity, m/s².
    float gravity[3];
    // Length of a step, seconds, from 0.000001 to 1. It belongs to the world: all processes that compute a world share it.
    float dt;
    // Lowest corner of the box that is cut into regions, metres. Bodies may leave the box: outer regions reach to infinity.
    double min[3];
    // Highest corner of the box that is cut into regions, metres, above the lowest along each axis.
    double max[3];
    // User data of the world; dcd_world_info gives it back.
    uint64_t user_data;
    // DCD_COUPLING_... constant: how regions come to consensus. It has no effect in a world of one region.
    DcdCoupling coupling;
    // DCD_PRESET_... constant: stands for DCD_COUPLING_AUTO and for exchanges, depth, island_limit and tolerance. With another
    // coupling it must be 0.
    DcdPreset preset;
    // Number of exchanges between regions per step, 1 to 64; with DCD_COUPLING_AUTO the most that a border may take. 0: what suits
    // the coupling.
    uint32_t exchanges;
    // Number of contact hops across a border within which bodies live in both regions, 1 to 16; 0: what suits the coupling.
    uint32_t depth;
    // Largest number of bodies of an island that moves whole to one region, up to 65534; 0: what suits the coupling.
    uint32_t island_limit;
    // Disagreement of copies that DCD_COUPLING_AUTO tolerates, m/s, above 0; 0: what suits the coupling.
    float tolerance;
    // DCD_CUT_... bits: the axes across which `regions` are cut; 0: all but that of gravity. With `regions` 0 it must be 0.
    uint32_t axes;
    // Largest speed of a dynamic body, m/s, up to DCD_MAX_NUMBER; 0: what the scene says, else 400. The speed of a body that
    // forces and contacts make faster is cut to it. A body that is made or set to be faster is refused. dcd_settings_set changes
    // it.
    float speed_limit;
    // DCD_FIDELITY_... constant: how much of the world is computed in full. dcd_viewpoints_set says where the world is looked at
    // from. It goes with the couplings that share mass: not with DCD_COUPLING_OWNER and DCD_COUPLING_PROXY.
    DcdFidelity fidelity;
    // Limit for `fidelity`, above 0: m/s with DCD_FIDELITY_TOLERANCE, milliseconds with DCD_FIDELITY_BUDGET. With all others it
    // is 0.
    float fidelity_limit;
    // Planes that cut the world, each through all of it, or null. Each must cut a region that those before it have left. With them,
    // `regions` and `axes` must be 0.
    const DcdCut *cuts;
    // Number of `cuts`. There may be 256 regions between them.
    uint32_t cut_count;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdWorldDef;

// Handle of a world of any role. 0 is null.
typedef struct DcdWorld {
    // Opaque number.
    uint64_t v;
} DcdWorld;

// Role of a process in a world.
typedef uint32_t DcdRole;

// Role, tick and settings of a world. Start from DCD_WORLD_INFO_INIT.
typedef struct DcdWorldInfo {
    // Size of this struct: sizeof(DcdWorldInfo).
    uint32_t struct_size;
    // Role of this process: DCD_ROLE_LOCAL, DCD_ROLE_CLIENT, DCD_ROLE_BUILDER, DCD_ROLE_PARTICIPANT, DCD_ROLE_SERVER or
    // DCD_ROLE_NODE.
    DcdRole role;
    // Number of steps since the world began; in a served world, the newest step heard of. There it lags by some milliseconds while
    // bodies move. While all bodies rest it comes every 30 steps, then every 5 s (dcd_view_time tells the tick meanwhile). At the
    // server it comes every 30 steps, and lags by up to 12 steps more.
    uint64_t tick;
    // User data that the program gave the world.
    uint64_t user_data;
    // Number of regions that the world is cut into; for a node, of those that this process computes.
    uint32_t regions;
    // Length of a step, seconds; 0 for a node, which takes it from its server, as gravity.
    float dt;
    // Gravity, m/s²; 0 for a node.
    float gravity[3];
    // Number by which the server knows this client, builder or participant, from 1; 0 for all others.
    uint32_t client;
    // Largest speed of a dynamic body, m/s, as dcd_settings_set left it; 0 for a node.
    float speed_limit;
    // Reserved; always 0.
    uint32_t reserved;
} DcdWorldInfo;

// Definition of a client that joins a served world. Start from DCD_CLIENT_DEF_INIT and give at least `server` and `token`.
typedef struct DcdClientDef {
    // Size of this struct: sizeof(DcdClientDef).
    uint32_t struct_size;
    // Time to wait for the server and the world, milliseconds; 0: 10,000.
    uint32_t timeout_ms;
    // Address of the server: "host:port", "192.0.2.1:port" or "[2001:db8::1]:port". Where servers stand by for one another (`dcd
    // serve --directory`), the addresses of all, separated by commas without spaces: the one that answers is the server, now and
    // later on.
    const char *server;
    // Token that `dcd token --role client` (or `builder`) or dcd_token_create gave. Joining uses it up.
    const char *token;
    // Path of a file that keeps the client's identity, or null. Joining writes the file. A client that joins with it again gets
    // back the avatars that were left behind. The file holds a secret.
    const char *identity_path;
    // User data of the world; dcd_world_info gives it back.
    uint64_t user_data;
    // Centre of the first area of interest, world space, metres.
    double interest_centre[3];
    // Radius of the first area of interest, metres. The client is told the bodies in the area, the scenery that reaches into it,
    // and the shapes and joints of those. What comes there later, or where dcd_interest_set moves the area to, appears
    // (DCD_CHANGE_APPEARED). 0: the client is told the whole world, whatever its interest is later on.
    double interest_radius;
    // Time that the server may be out of reach later on before dcd_step gives up, milliseconds; 0: 30,000. It counts from when the
    // client has noticed, which is 10 to 14 s after it last heard of a server that was killed (2 to 3 s where `server` names several).
    uint32_t give_up_ms;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdClientDef;

// Definition of a participant that joins a served world. Start from DCD_PARTICIPANT_DEF_INIT and give at least `server` and
// `token`.
typedef struct DcdParticipantDef {
    // Size of this struct: sizeof(DcdParticipantDef).
    uint32_t struct_size;
    // Time to wait for the server and the world, milliseconds, as in DcdClientDef.
    uint32_t timeout_ms;
    // Address of the server, as in DcdClientDef.
    const char *server;
    // Token that `dcd token --role participant` or dcd_token_create gave. Joining uses it up.
    const char *token;
    // Path of the identity file, as in DcdClientDef.
    const char *identity_path;
    // User data of the world; dcd_world_info gives it back.
    uint64_t user_data;
    // Number of threads that compute the participant's share of the world, 1 to 1024; 0: one per core.
    uint32_t threads;
    // Time that the server may be out of reach later on before dcd_step gives up, milliseconds; 0: the participant waits without
    // end, since it computes a share of the world.
    uint32_t give_up_ms;
    // Centre of the first area of interest, metres, as in DcdClientDef.
    double interest_centre[3];
    // Radius of the first area of interest, metres, as in DcdClientDef.
    double interest_radius;
    // Path of a file to record to, for `dcd replay`, or null. The recording holds all that the participant's share of the world is
    // given, and a digest of each region after each tick.
    const char *record_path;
    // Address at which the participant's node answers with its metrics, or null, as in DcdServerDef.
    const char *metrics;
} DcdParticipantDef;

// Id of a body. 0 is null. A body has one id for as long as the world's handle lives, whichever region owns it. Other processes,
// and later handles of the same world, know it by other ids. An id of another world is stale in this world.
//
// An id is not given again, so that the id of a destroyed body stays stale for ever. Forget ids at DCD_CHANGE_REMOVED, because there
// are exceptions:
// - dcd_checkpoint_restore goes back to a time before the id was given.
// - A client that leaves and joins again with its identity file numbers new avatars from those on that are left of its last stay.
//   A new avatar may get the id of a destroyed one.
// - After its server was started again, a builder may get the id of a destroyed body for what it makes.
typedef struct DcdBodyId {
    // Opaque number.
    uint64_t v;
} DcdBodyId;

// Settings by which nodes form groups and keep in step. Start from DCD_GROUP_DEF_INIT.
typedef struct DcdGroupDef {
    // Size of this struct: sizeof(DcdGroupDef).
    uint32_t struct_size;
    // Largest number of ticks by which nodes run ahead of one another, and extrapolate, 0 to 60; 0: lockstep. Above 0 the coupling
    // must be DCD_COUPLING_OWNER.
    uint32_t lag_ticks;
    // Round trip below which nodes share a group, milliseconds; 0: all nodes that reach each other share one.
    float near_ms;
    // Round trip above which members are voted out of their group, milliseconds; above near_ms, and 0 where that is 0.
    float far_ms;
    // Largest distance of a body from its place in the group that is authoritative for it, metres, above 0.
    float agree;
    // Largest number of nodes in a group, 1 to 1024.
    uint32_t size;
} DcdGroupDef;

// Definition of a server. Start from DCD_SERVER_DEF_INIT and give at least `data_path` and one of `scene` and `source`.
typedef struct DcdServerDef {
    // Size of this struct: sizeof(DcdServerDef).
    uint32_t struct_size;
    // Number of nodes to wait for before the first tick, 1 to 1024.
    uint32_t nodes;
    // Name of a scene of the library, or path of a scene file, as in dcd_world_open_scene; null with `source`.
    const char *scene;
    // Texts "name=value" that change parameters of the scene, or null.
    const char *const *params;
    // Number of texts in `params`.
    size_t param_count;
    // Cut and coupling of the world, or null. The same members count as in dcd_world_open_scene.
    const DcdWorldDef *world;
    // Local world to serve as it is now, with its cut and settings; else null (v is 0). It is copied and stays the program's.
    // Bodies keep their user data, and have other handles in the worlds that join. With it, `scene`, `params` and `world` are
    // null. Callbacks (hooks) and the strengths of joints stay behind: a served world has none.
    DcdWorld source;
    // How nodes form groups, or null for DCD_GROUP_DEF_INIT.
    const DcdGroupDef *groups;
    // Address to listen at, such as "127.0.0.1:7420", "0.0.0.0:7420" or "[::]:7420"; port 0 takes any free one (dcd_address).
    const char *listen;
    // Path of a folder, made if need be, that keeps the server's keys, the list of used tokens, and the world. A server that died
    // goes on with the world when one is made in the same way. Each server has a folder of its own.
    const char *data_path;
    // Tick after which the world ends; 0: it ends when it is destroyed.
    uint64_t last_tick;
    // Largest speed at which clients may move their avatars, m/s, above 0 and up to 100,000.
    float avatar_speed;
    // DCD_SERVER_... bits.
    uint32_t flags;
    // User data of the world; dcd_world_info gives it back.
    uint64_t user_data;
    // Number of steps from one state of a moving body that clients are told to the next, 1 to 30. Clients show the steps between
    // by interpolation (dcd_view_time). 1 tells each step, in up to three times the bytes of 3.
    uint32_t state_every;
    // Share of participants, 0 to 1, whose regions the leader computes once more, to compare; 0: none. A participant that
    // computes otherwise is sent away. Which ones are drawn is not told. It needs lockstep, and a node that is no participant and
    // computes as many more regions.
    float verify;
    // Address at which the server answers over HTTP with its metrics (/metrics, in Prometheus' text format) and whether it is well
    // (/healthz, /readyz), such as "127.0.0.1:9420"; port 0 takes any free one (dcd_metrics_address). Whoever reaches it may read
    // them. Null: nowhere, and nothing is measured.
    const char *metrics;
    // Place in etcd that keeps the world instead of the folder: "etcd://HOST:PORT[,HOST:PORT...]/NAME", in a library that is built
    // with its feature etcd. Null: the folder keeps the world.
    //
    // Servers with the same place, scene and settings stand by for one another: dcd_server_create waits until none of the others
    // serves.
    //
    // Over TLS the place is "etcds://HOST:PORT/NAME?cacert=FILE", with "&cert=FILE&key=FILE" where etcd asks for certificates, and
    // "&user=NAME&password-file=FILE" where it has users. Without a file the password is in the environment (`DCD_ETCD_PASSWORD`).
    const char *directory;
    // Path of a file to record to, for `dcd replay`, or null. The recording holds all that the server is given. A file that holds
    // something is refused: it may say what went wrong before.
    const char *record_path;
    // Time that the avatars of a client that left wait for its return (DcdClientDef.identity_path) before they are removed,
    // seconds, above 0 and up to 31,536,000.
    float avatar_expiry;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdServerDef;

// Definition of a node that joins a served world. Start from DCD_NODE_DEF_INIT and give at least `server` and `token`.
typedef struct DcdNodeDef {
    // Size of this struct: sizeof(DcdNodeDef).
    uint32_t struct_size;
    // Time to wait for the server and the world, milliseconds, as in DcdClientDef.
    uint32_t timeout_ms;
    // Address of the server, as in DcdClientDef.
    const char *server;
    // Token that dcd_token_create or `dcd token --role node` gave. Joining uses it up. A used token will do where the file of
    // identity_path exists already.
    const char *token;
    // Path of the identity file, as in DcdClientDef.
    const char *identity_path;
    // Address at which other nodes reach this one, such as "192.0.2.7:7421", or null: any free port of the interface towards the
    // server.
    const char *listen;
    // User data of the world; dcd_world_info gives it back.
    uint64_t user_data;
    // Number of threads that compute the node's share of the world, 1 to 1024; 0: one per core.
    uint32_t threads;
    // Time that the server may be out of reach later on before the node gives up, milliseconds; 0: the node waits without end, and
    // computes on.
    uint32_t give_up_ms;
    // Path of a file to record to, for `dcd replay`, or null, as in DcdServerDef. The recording holds all that the node is given,
    // and a digest of each region after each tick.
    const char *record_path;
    // Address at which the node answers with its metrics, or null, as in DcdServerDef.
    const char *metrics;
    // Address to give to other nodes and clients, where it is not the one listened at, as behind a NAT; or null.
    const char *advertise;
} DcdNodeDef;

// Id of a shape of one world. 0 is null.
typedef struct DcdShapeId {
    // Opaque number.
    uint64_t v;
} DcdShapeId;

// Pose relative to a body or a shape: position and rotation.
typedef struct DcdFrame {
    // Position, metres.
    float p[3];
    // Rotation: unit quaternion x, y, z, w (to 0.001).
    float q[4];
} DcdFrame;

// Type of a body: how it moves.
typedef uint32_t DcdBodyType;

// Pose in world space: position and rotation.
typedef struct DcdPose {
    // Position of the body's origin, metres.
    double p[3];
    // Rotation: unit quaternion x, y, z, w (to 0.001).
    float q[4];
} DcdPose;

// Velocity of a body, in world axes.
typedef struct DcdVelocity {
    // Velocity of the centre of mass, m/s.
    float linear[3];
    // Angular velocity, rad/s.
    float angular[3];
} DcdVelocity;

// Rule by which the coefficients of two colliders in contact become one. Of two rules, the one with the higher number counts.
typedef uint32_t DcdCombineRule;

// Definition of a body. Start from DCD_BODY_DEF_INIT and give at least `shape`. dcd_body_set_properties and
// dcd_collider_set_properties change it later.
typedef struct DcdBodyDef {
    // Size of this struct: sizeof(DcdBodyDef).
    uint32_t struct_size;
    // Type: DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    DcdBodyType body_type;
    // Pose at first.
    DcdPose pose;
    // Velocity at first.
    DcdVelocity velocity;
    // Shape of its first collider, of the same world. Two bodies may share one. dcd_collider_add gives a body more.
    DcdShapeId shape;
    // Density, kg/m³, 0 or more. A dynamic body needs mass by density, `mass` or `extra_mass`. A mesh that is not closed, and
    // terrain, have none by density.
    float density;
    // Mass of the shape, kilograms, instead of that by density; 0: by density.
    float mass;
    // Friction: Coulomb coefficient, 0 or more.
    float friction;
    // Restitution, 0 (no bounce) to 1 (all of the speed).
    float restitution;
    // DCD_COMBINE_… rule by which two bodies in contact combine their friction.
    DcdCombineRule friction_rule;
    // DCD_COMBINE_… rule by which two bodies in contact combine their restitution.
    DcdCombineRule restitution_rule;
    // Distance that the shape is kept away from others, metres, 0 or more. A thin cushion makes contacts cheaper and calmer.
    float contact_skin;
    // Damping of movement, 1/s, 0 or more.
    float linear_damping;
    // Damping of turning, 1/s, 0 or more.
    float angular_damping;
    // Factor on gravity.
    float gravity_scale;
    // DCD_BODY_… bits.
    uint32_t flags;
    // DCD_LOCK_… bits: axes of the world that a dynamic body does not follow.
    uint32_t locked;
    // DCD_EVENT_… bits. A contact is reported when either body asks for it.
    uint32_t events;
    // Force above which DCD_EVENT_FORCE reports a contact, newtons, 0 or more.
    float force_threshold;
    // Groups that the body belongs to, as bits.
    uint32_t groups;
    // Groups that the body meets, as bits. Two bodies collide when each meets a group of the other.
    uint32_t mask;
    // Groups that the body belongs to when it comes to pushing, as bits. Contacts of bodies that do not push each other are
    // reported and do nothing.
    uint32_t solver_groups;
    // Groups that push the body and that it pushes, as bits.
    uint32_t solver_mask;
    // DCD_PAIR_… bits: which types of bodies the body meets. A pair meets when either body asks for it.
    uint32_t pairs;
    // Dominance, -128 to 127. Of two bodies in contact, the higher is not moved by the lower, which meets it like a wall at rest:
    // Rapier leaves the velocity of the higher out, so that it neither pushes nor carries the lower. A kinematic body does both.
    int32_t dominance;
    // Distance ahead at which the body looks for what it may meet, metres; 0: none. It is cheaper than DCD_BODY_CCD, and not as
    // sure.
    float soft_ccd;
    // Speed below which the body may fall asleep, m/s, 0 or more.
    float sleep_linear;
    // Spin below which the body may fall asleep, rad/s, 0 or more.
    float sleep_angular;
    // Time that the body must have been so slow before it falls asleep, seconds, 0 or more. In a served world sleep_linear,
    // sleep_angular and sleep_after must be as in DCD_BODY_DEF_INIT.
    float sleep_after;
    // Mass besides that of the shape, kilograms, 0 or more. With extra_centre and extra_inertia 0 it makes the shape heavier as it
    // is.
    float extra_mass;
    // Centre of the extra mass, from the body's origin, metres.
    float extra_centre[3];
    // Moments of inertia of the extra mass about the body's x, y and z through extra_centre, kg m², 0 or more.
    float extra_inertia[3];
    // Number of solver iterations more than others have, for the body and what touches it, 0 to 1000.
    uint32_t extra_solver_iterations;
    // Number of additional iterations within each solver iteration, 0 to 1000.
    uint32_t extra_pgs_iterations;
    // DCD_HOOK_… bits of its shape: the functions of dcd_hooks_set that are asked about it.
    uint32_t hooks;
    // User data of the body; events, views and ray hits carry it.
    uint64_t user_data;
    // User data of its shape, such as the number of a material (DcdColliderProperties.user_data); contacts and hits carry it.
    uint64_t material;
} DcdBodyDef;

// Settings of a character. Start from DCD_CHARACTER_DEF_INIT.
typedef struct DcdCharacterDef {
    // Size of this struct: sizeof(DcdCharacterDef).
    uint32_t struct_size;
    // Height of the highest step that the character climbs without a jump, metres, 0 to 100; 0: it climbs none.
    float step_height;
    // Free floor that there must be on a step, metres, 0 to 100.
    float step_depth;
    // Steepest slope that the character climbs, radians, 0 to pi / 2.
    float max_climb;
    // Least steep slope that the character slides down, radians, 0 to pi / 2.
    float min_slide;
    // Height by which the character is drawn down to the ground as it walks downhill, metres, 0 to 100; 0: it is in the air
    // instead.
    float snap;
    // Gap that the character keeps from all else, metres, above 0 and at most 1.
    float gap;
    // Mass with which the character pushes dynamic bodies and stands on them, kilograms, 0 to 1e9; 0: it pushes none.
    float mass;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdCharacterDef;

// Wheel of a vehicle. Points and directions are relative to the chassis. Start from DCD_WHEEL_INIT: a wheel of a car of a tonne,
// forward along x, upward along y, neither driven nor steered.
typedef struct DcdWheel {
    // Point where the suspension begins, metres, within 100 of the chassis.
    float at[3];
    // Direction in which the suspension points, of length 1.
    float down[3];
    // Direction of the axle, of length 1: the wheel rolls forward in the direction of axle x down.
    float axle[3];
    // Length of the suspension without a load, metres, 0 to 100.
    float rest_length;
    // Largest way by which the suspension is pressed from rest_length, metres, 0 to 100.
    float travel;
    // Radius of the wheel, metres, above 0 and at most 100.
    float radius;
    // Stiffness of the suspension per kilogram of the chassis, 1/s², 0 to 1e9.
    float stiffness;
    // Damping of the suspension as it is pressed, per kilogram of the chassis, 1/s, 0 to 1e9.
    float compression;
    // Damping of the suspension as it is released, per kilogram of the chassis, 1/s, 0 to 1e9.
    float relaxation;
    // Largest force of the suspension, newtons, 0 to 1e9.
    float max_force;
    // Grip, 0 to 1000: across, the wheel holds up to this many times the force that its suspension bears; along, twice as much.
    float grip;
    // Part of a sideways slip that the wheel takes, 0 to 1; with 1 it takes a fifth in each substep.
    float side_grip;
    // Force of the engine on the wheel at full throttle, newtons, 0 to 1e9.
    float engine_force;
    // Force of the wheel's brake, newtons, 0 to 1e9.
    float brake_force;
    // Angle by which the wheel turns when steered, radians, -pi / 2 to pi / 2; above 0 to the left.
    float steering;
} DcdWheel;

// Settings of a vehicle. Start from DCD_VEHICLE_DEF_INIT: a car of 3.2 x 1.6 m and about a tonne, driven behind, steered in front.
typedef struct DcdVehicleDef {
    // Size of this struct: sizeof(DcdVehicleDef).
    uint32_t struct_size;
    // Number of wheels, 1 to 32; 0: the four of that car.
    uint32_t wheel_count;
    // Wheels, which are copied; null with a wheel_count of 0.
    const DcdWheel *wheels;
    // Speed above which the engine does not speed the vehicle up, m/s, above 0 and at most 10000.
    float top_speed;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdVehicleDef;

// Controls of a vehicle.
typedef struct DcdDrive {
    // Part of the engine's force, -1 (backward) to 1.
    float throttle;
    // Part of the brakes' force, 0 to 1. With throttle it has no effect on wheels that are driven.
    float brake;
    // Part of the wheels' steering angle, -1 to 1.
    float steering;
} DcdDrive;

// Ground under a character or a wheel. Where there is none, `body` is null and all else is 0.
typedef struct DcdGround {
    // Body that is the ground.
    DcdBodyId body;
    // user_data of its collider there, such as the number of a material.
    uint64_t material;
    // Point on its surface, world space, metres.
    double point[3];
    // Normal there, out of the ground, of length 1.
    float normal[3];
    // Angle between the normal and the direction against gravity, radians: 0 on level ground.
    float slope;
    // Number of the collider, from 0.
    uint32_t collider;
    // Reserved; always 0.
    uint32_t reserved;
} DcdGround;

// Stance of a character after the last step. Start from DCD_CHARACTER_STATE_INIT. The struct may grow at its end.
typedef struct DcdCharacterState {
    // Size of this struct: sizeof(DcdCharacterState).
    uint32_t struct_size;
    // Says whether the character stands on something. Only then can it jump.
    bool grounded;
    // Says whether the character slides down ground that is steeper than its min_slide.
    bool sliding;
    // Reserved; always 0.
    uint8_t reserved[2];
    // Flattest ground that the character touches; none in the air, and where what it stood on has gone in the same step.
    DcdGround ground;
} DcdCharacterState;

// State of a wheel after the last step: where to draw it, and on what it stands.
typedef struct DcdWheelState {
    // Centre of the wheel in world space, and its rotation: that of the chassis, then steered, then rolled.
    DcdPose pose;
    // Length of the suspension, from DcdWheel.at to the centre of the wheel, metres.
    float suspension;
    // Angle by which the wheel is steered about its suspension, radians; above 0 to the left.
    float steering;
    // Angle by which the wheel has rolled forward, radians, -pi to pi; 0 at first, and after dcd_snapshot_load.
    float rolled;
    // Speed at which the wheel rolls forward, rad/s. In the air it slows down by 1 % per step.
    float spin;
    // Ground on which the wheel stands; none in the air.
    DcdGround ground;
} DcdWheelState;

// State of a body besides pose and velocity. Start from DCD_BODY_INFO_INIT.
typedef struct DcdBodyInfo {
    // Size of this struct: sizeof(DcdBodyInfo).
    uint32_t struct_size;
    // Type: DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    DcdBodyType body_type;
    // User data of the body.
    uint64_t user_data;
    // Centre of mass, world space, metres; in a served world the body's origin.
    double centre[3];
    // Mass, kilograms; 0 for a fixed body, and in a served world, where it is not told.
    float mass;
    // Region that owns the body, as in DcdRegionInfo; DCD_NO_REGION for a fixed body and for an avatar that has not appeared yet.
    // In a served world as DcdOwner.region.
    uint32_t region;
    // Force that dcd_body_set_force and dcd_body_add_force put on the body, newtons.
    float force[3];
    // Torque that dcd_body_set_force and dcd_body_add_force put on the body, newton metres.
    float torque[3];
    // Number of the body's colliders.
    uint32_t colliders;
    // Says whether the body sleeps: it costs nothing until something wakes it.
    bool sleeping;
    // Says whether this process's interest does not reach the body (dcd_interest_set). Then this is what was last heard of it.
    bool outside;
    // Reserved; always 0.
    uint8_t reserved[2];
} DcdBodyInfo;

// Explosion. Start from DCD_EXPLOSION_INIT and give its centre. The struct may grow at its end.
typedef struct DcdExplosion {
    // Size of this struct: sizeof(DcdExplosion).
    uint32_t struct_size;
    // Groups of which a collider must be in one to be pushed, as bits; 0xFFFFFFFF for all.
    uint32_t mask;
    // Centre of the explosion, world space, metres.
    double centre[3];
    // Distance up to which the explosion has its full strength, metres, 0 or more; to the nearest point of a collider.
    float radius;
    // Distance beyond `radius` in which the explosion weakens, linearly down to nothing, metres, 0 or more.
    float falloff;
    // Impulse per area of the silhouette that a collider shows to the explosion, N s/m²; negative draws bodies in.
    float impulse;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdExplosion;

// Fluid, water or air, in a box. Start from DCD_FLUID_INIT. The struct may grow at its end.
typedef struct DcdFluid {
    // Size of this struct: sizeof(DcdFluid).
    uint32_t struct_size;
    // Groups of which a collider must be in one to be pushed, as bits; 0xFFFFFFFF for all.
    uint32_t mask;
    // Lowest corner of the box that the fluid is in, metres; may be infinite.
    double min[3];
    // Highest corner of the box that the fluid is in, metres; may be infinite.
    double max[3];
    // Height at which the fluid stands, metres from the origin against gravity (along +y without gravity); infinite where it fills
    // its box.
    double surface;
    // Density, kg/m³, 0 or more.
    float density;
    // Velocity at which the fluid flows, or the wind blows, m/s.
    float velocity[3];
    // Coefficient c of drag, 0 or more: 0.5 for balls, 1 for boxes.
    float drag;
    // Rate at which motion and spin die down besides, for a body as heavy as what it displaces, 1/s, 0 or more.
    float damping;
    // Coefficient l of dynamic lift, 0 or more: 1 for plates, 0 for none.
    float lift;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdFluid;

// Properties of a body, except those of its colliders: the members of DcdBodyDef, to be read and changed later. Start from
// DCD_BODY_PROPERTIES_INIT and dcd_body_properties.
typedef struct DcdBodyProperties {
    // Size of this struct: sizeof(DcdBodyProperties).
    uint32_t struct_size;
    // Type: DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    DcdBodyType body_type;
    // DCD_BODY_CCD, DCD_BODY_NO_SLEEP, DCD_BODY_DISABLED, DCD_BODY_FAST_SPIN and DCD_BODY_NO_GYRO bits.
    uint32_t flags;
    // DCD_LOCK_… bits: axes of the world that a dynamic body does not follow.
    uint32_t locked;
    // Dominance, -128 to 127. This and all that follows is as in DcdBodyDef.
    int32_t dominance;
    // Damping of movement, 1/s.
    float linear_damping;
    // Damping of turning, 1/s.
    float angular_damping;
    // Factor on gravity.
    float gravity_scale;
    // Distance ahead at which the body looks for what it may meet, metres.
    float soft_ccd;
    // Speed below which the body may fall asleep, m/s.
    float sleep_linear;
    // Spin below which the body may fall asleep, rad/s.
    float sleep_angular;
    // Time that the body must have been so slow before it falls asleep, seconds.
    float sleep_after;
    // Mass besides that of the shapes, kilograms.
    float extra_mass;
    // Centre of the extra mass, from the body's origin, metres.
    float extra_centre[3];
    // Moments of inertia of the extra mass about the body's x, y and z, kg m². For a part of a model (MJCF, URDF) they are about
    // the part's principal axes, which may be turned on the body, and which stay until its extra_mass is 0.
    float extra_inertia[3];
    // Number of solver iterations more than others have.
    uint32_t extra_solver_iterations;
    // Number of additional iterations within each solver iteration.
    uint32_t extra_pgs_iterations;
    // Reserved; must be 0.
    uint32_t reserved;
    // User data of the body.
    uint64_t user_data;
} DcdBodyProperties;

// Properties of one collider of a body. Start from DCD_COLLIDER_PROPERTIES_INIT, or from dcd_collider_properties.
typedef struct DcdColliderProperties {
    // Size of this struct: sizeof(DcdColliderProperties).
    uint32_t struct_size;
    // DCD_COLLIDER_… bits.
    uint32_t flags;
    // Pose of the collider on the body.
    DcdFrame frame;
    // Density, kg/m³, 0 or more. When read later, it is 0 where the mass was given, or centre and inertia with it (by Rapier's own
    // setters).
    float density;
    // Mass, kilograms; 0: by density.
    float mass;
    // Friction: Coulomb coefficient, 0 or more. This and all that follows is as in DcdBodyDef.
    float friction;
    // Restitution, 0 to 1.
    float restitution;
    // DCD_COMBINE_… rule for friction.
    DcdCombineRule friction_rule;
    // DCD_COMBINE_… rule for restitution.
    DcdCombineRule restitution_rule;
    // Distance that the collider is kept away from others, metres.
    float contact_skin;
    // DCD_EVENT_… bits.
    uint32_t events;
    // Force above which DCD_EVENT_FORCE reports a contact, newtons.
    float force_threshold;
    // Groups that the collider belongs to, as bits.
    uint32_t groups;
    // Groups that the collider meets, as bits.
    uint32_t mask;
    // Groups that the collider belongs to when it comes to pushing, as bits.
    uint32_t solver_groups;
    // Groups that push the collider and that it pushes, as bits.
    uint32_t solver_mask;
    // DCD_PAIR_… bits: which types of bodies the collider meets.
    uint32_t pairs;
    // DCD_HOOK_… bits: the functions of dcd_hooks_set that are asked about it.
    uint32_t hooks;
    // User data of the collider, such as the number of its material; contacts and hits carry it.
    uint64_t user_data;
} DcdColliderProperties;

// Kind of a shape. Later versions may add kinds: read shapes of unknown kinds by their vertices and triangles.
typedef uint32_t DcdShapeKind;

// Kind and measures of a shape. Start from DCD_SHAPE_INFO_INIT.
typedef struct DcdShapeInfo {
    // Size of this struct: sizeof(DcdShapeInfo).
    uint32_t struct_size;
    // Kind: DCD_SHAPE_BOX and so on.
    DcdShapeKind kind;
    // Sizes by kind, metres; 0 for a kind that has none.
    float size[3];
    // Border by which the shape is rounded, metres: it reaches so far beyond its size or its vertices.
    float border;
    // Pose of all this, from the shape's origin. It is elsewhere only for capsules and half-spaces that lie otherwise.
    DcdFrame frame;
    // Number of vertices that dcd_shape_vertices reads; 0 for boxes, balls, capsules, cylinders, cones, half-spaces and compounds.
    uint32_t vertex_count;
    // Number of triangles that dcd_shape_triangles reads.
    uint32_t triangle_count;
    // Number of heights along z, for terrain.
    uint32_t rows;
    // Number of heights along x, for terrain.
    uint32_t columns;
    // Number of shapes that dcd_shape_part finds, for a compound.
    uint32_t parts;
    // Reserved; always 0.
    uint32_t reserved;
} DcdShapeInfo;

// Size and mass of a body. Start from DCD_BODY_EXTENT_INIT.
typedef struct DcdBodyExtent {
    // Size of this struct: sizeof(DcdBodyExtent).
    uint32_t struct_size;
    // Mass, kilograms; 0 for a fixed body.
    float mass;
    // Lowest corner of the smallest box along the axes of world space that holds the body's colliders, metres; infinite for a
    // half-space.
    double min[3];
    // Highest corner of that box, metres.
    double max[3];
    // Centre of mass, from the body's origin, along its own axes, metres.
    float centre[3];
    // Moments of inertia about the principal axes through the centre of mass, kg m²; 0 for a fixed body.
    float inertia[3];
    // Rotation from the body's own axes to the principal ones: unit quaternion x, y, z, w.
    float axes[4];
} DcdBodyExtent;

// Type of a joint: what it lets free. Each type has axes of its own, to which `limit` and `motor` of DcdJointDef apply.
typedef uint32_t DcdJointType;

// Model of a motor: whether stiffness and damping are per unit of mass.
typedef uint32_t DcdMotorModel;

// Motor of an axis. It applies stiffness * (position - where it is) + damping * (velocity - how fast it moves), at most max_force.
// Start from DCD_JOINT_MOTOR_INIT, which holds the axis still by any force. For a speed give `velocity`; for a servo `position`,
// `stiffness` and `damping`.
typedef struct DcdJointMotor {
    // Position that the motor drives to, metres or radians.
    float position;
    // Velocity that the motor drives at, m/s or rad/s.
    float velocity;
    // Stiffness, 0 or more; 0 heeds the velocity alone.
    float stiffness;
    // Damping, 0 or more.
    float damping;
    // Largest force or torque, newtons or newton metres; finite, 0 or more.
    float max_force;
    // Model: DCD_MOTOR_ACCELERATION or DCD_MOTOR_FORCE.
    DcdMotorModel model;
} DcdJointMotor;

// Definition of a joint. Start from DCD_JOINT_DEF_INIT and give `a` and `b`.
typedef struct DcdJointDef {
    // Size of this struct: sizeof(DcdJointDef).
    uint32_t struct_size;
    // Type: DCD_JOINT_FIXED to DCD_JOINT_GENERIC.
    DcdJointType joint_type;
    // First body.
    DcdBodyId a;
    // Second body, another one than `a`.
    DcdBodyId b;
    // Frame of the joint on `a`. The joint brings the two frames together.
    DcdFrame frame_a;
    // Frame of the joint on `b`.
    DcdFrame frame_b;
    // Lowest and highest position of `b` seen from `a` along or about the type's own axes, metres or radians, with
    // DCD_JOINT_LIMIT. -INFINITY and INFINITY leave a side open.
    float limit[2];
    // Motor that drives the type's own axes, with DCD_JOINT_MOTOR.
    DcdJointMotor motor;
    // DCD_JOINT_LIMIT, DCD_JOINT_MOTOR, DCD_JOINT_COLLIDE and DCD_JOINT_DISABLED bits.
    uint32_t flags;
    // Axes that a DCD_JOINT_GENERIC does not let free, as bits 1 << DCD_AXIS_…; for other types 0.
    uint32_t locked;
    // Free axes of a DCD_JOINT_GENERIC that count as one, as bits; for other types 0. Two or three axes along may be coupled:
    // their position is their common distance. Two axes about may be coupled: their position is the angle between the third axes,
    // as of a cone. Coupled axes have one limit, and those along have one motor.
    uint32_t coupled;
    // Natural frequency with which the joint holds what it locks and limits, hertz, above 0: how stiff it is. Less than 1 / dt is
    // soft.
    float natural_frequency;
    // Damping ratio, 0 or more: how fast an error of the joint calms down; 1 is without swinging.
    float damping_ratio;
    // Reserved; must be 0.
    uint32_t reserved;
    // User data of the joint; dcd_joint_info gives it back.
    uint64_t user_data;
} DcdJointDef;

// Id of a joint. 0 is null. An id is not given again, except after dcd_checkpoint_restore and for the joints of builders, as with
// DcdBodyId.
typedef struct DcdJointId {
    // Opaque number.
    uint64_t v;
} DcdJointId;

// State of a joint. Start from DCD_JOINT_INFO_INIT.
typedef struct DcdJointInfo {
    // Size of this struct: sizeof(DcdJointInfo).
    uint32_t struct_size;
    // Type, by what the joint lets free: one made generic may be a hinge, and a rope with a motor is a spring.
    DcdJointType joint_type;
    // First body.
    DcdBodyId a;
    // Second body.
    DcdBodyId b;
    // User data of the joint.
    uint64_t user_data;
    // Frame of the joint on `a`.
    DcdFrame frame_a;
    // Frame of the joint on `b`.
    DcdFrame frame_b;
    // frame_b seen from frame_a, as the bodies are now.
    DcdFrame offset;
    // Position: angle of a revolute joint, -π to π; way of a prismatic one; distance of a rope or spring; else 0.
    float position;
    // Force in the last step that held the axes along x, y and z of frame_a that the joint locks, newtons. Rapier mixes what it
    // solves, so take it for an estimate, such as of what should break the joint. 0 in a served world, where it is not told.
    float force[3];
    // Natural frequency, hertz, as in DcdJointDef.
    float natural_frequency;
    // Damping ratio, as in DcdJointDef.
    float damping_ratio;
    // DCD_JOINT_LIMIT, DCD_JOINT_MOTOR, DCD_JOINT_COLLIDE and DCD_JOINT_DISABLED bits.
    uint32_t flags;
    // Axes that are not free, as bits 1 << DCD_AXIS_….
    uint32_t locked;
    // Axes that count as one, as bits 1 << DCD_AXIS_….
    uint32_t coupled;
    // Axes with a limit, as bits 1 << DCD_AXIS_….
    uint32_t limited;
    // Axes with a motor, as bits 1 << DCD_AXIS_….
    uint32_t driven;
} DcdJointInfo;

// Axis of a joint's frame on body `a`: along it, or about it. As a bit it is 1 << axis, as DCD_LOCK_… bits are.
typedef uint32_t DcdJointAxis;

// Task of the library. The program calls it once, on any thread, with the `task` that came with it. It returns when the step needs
// it no more.
typedef void (*DcdTaskFn)(void *task);

// Starts `run(task)` on a thread of the program's and returns at once. The result is anything by which DcdFinishFn knows the task
// again. A job system that has no thread free may begin the task later, or within DcdFinishFn: then the task has nothing to do.
typedef void *(*DcdEnqueueFn)(void *context, DcdTaskFn run, void *task);

// Waits until the task for which DcdEnqueueFn returned `started` has returned. Begins the task if it was not begun.
typedef void (*DcdFinishFn)(void *context, void *started);

// Job system of the program. Start from DCD_TASKS_INIT.
typedef struct DcdTasks {
    // Size of this struct: sizeof(DcdTasks).
    uint32_t struct_size;
    // Reserved; must be 0.
    uint32_t reserved;
    // First argument of both functions.
    void *context;
    // Function that starts a task.
    DcdEnqueueFn enqueue;
    // Function that waits for a task.
    DcdFinishFn finish;
} DcdTasks;

// Model of friction.
typedef uint32_t DcdFrictionModel;

// Settings by which a world is stepped. Start from DCD_SETTINGS_INIT and dcd_settings. The struct may grow at its end.
typedef struct DcdSettings {
    // Size of this struct: sizeof(DcdSettings).
    uint32_t struct_size;
    // Number of solver iterations per step, 1 to 1000.
    uint32_t solver_iterations;
    // Gravity, m/s².
    float gravity[3];
    // Length of a step, seconds, from 0.000001 to 1.
    float dt;
    // Units of length per metre, above 0: 100 if the program's numbers are centimetres. It scales the tolerances of the solver,
    // the thresholds of sleep, and `max_correction`. Gravity, `speed_limit`, densities and all else are numbers in the program's
    // units.
    float length_unit;
    // Largest speed of a dynamic body (DcdWorldDef.speed_limit), m/s, above 0, up to DCD_MAX_NUMBER.
    float speed_limit;
    // Natural frequency of contacts, 1/s, 0 or more: higher is stiffer.
    float contact_frequency;
    // Damping ratio of contacts, 0 or more: higher takes overlaps away more slowly.
    float contact_damping;
    // Natural frequency of contacts with fixed bodies, 1/s, 0 or more.
    float static_frequency;
    // Damping ratio of contacts with fixed bodies, 0 or more.
    float static_damping;
    // Largest speed at which overlaps are taken away, m/s, 0 or more.
    float max_correction;
    // Overlap that is left as it is, metres, 0 or more.
    float allowed_overlap;
    // Distance ahead at which contacts are looked for, metres, 0 or more.
    float contact_margin;
    // Part of the last step's impulses with which the next begins (warm start), 0 to 1.
    float warm_start;
    // Number of iterations within each solver iteration, 1 to 1000.
    uint32_t internal_iterations;
    // Largest number of substeps by which bodies with DCD_BODY_CCD are swept in a step, 0 to 1000.
    uint32_t ccd_substeps;
    // Disagreement of copies that DCD_COUPLING_AUTO tolerates, m/s, above 0.
    float tolerance;
    // DCD_FRICTION_... constant: how friction is solved.
    DcdFrictionModel friction_model;
} DcdSettings;

// State of every movable body after a step. Entry i of each array belongs to ids[i]. The order only changes where bodies are made
// or destroyed. Start from DCD_STATE_VIEW_INIT. The arrays are null when `count` is 0.
typedef struct DcdStateView {
    // Size of this struct: sizeof(DcdStateView).
    uint32_t struct_size;
    // Length that an array of the program's own, indexed by slot, needs: above every slot of every view up to now.
    uint32_t slot_count;
    // Number of the step after which the bodies were in this state.
    uint64_t tick;
    // Length of each array.
    size_t count;
    // Ids of the bodies.
    const DcdBodyId *ids;
    // Poses of the bodies.
    const DcdPose *poses;
    // Velocities of the bodies.
    const DcdVelocity *velocities;
    // User data of the bodies.
    const uint64_t *user_data;
    // DCD_STATE_… bits of the bodies.
    const uint32_t *flags;
    // Regions that own the bodies, as in DcdRegionInfo. For a server, which is told no owners, the regions that they lie in.
    const uint32_t *regions;
    // Slots of the bodies: indices below `slot_count`, by which the program may keep its own data of each body in an array beside
    // these.
    //
    // A body has the same slot in every view of its world (dcd_state_view and dcd_view_state alike) for as long as views show it,
    // whatever its place in them. Low slots are given first. A slot that becomes free in a view is given anew in a later one, so
    // no slot belongs to two bodies in two successive views. A program that leaves views out, or calls dcd_checkpoint_restore,
    // must compare ids.
    const uint32_t *slots;
} DcdStateView;

// Field of a body that dcd_state_read and dcd_state_write copy.
typedef uint32_t DcdField;

// Ticks to show now. A fraction is a time between two ticks: 7.5 is halfway from the world after step 7 to that after step 8.
// Start from DCD_VIEW_TIME_INIT.
typedef struct DcdViewTime {
    // Size of this struct: sizeof(DcdViewTime).
    uint32_t struct_size;
    // Reserved; must be 0.
    uint32_t reserved;
    // Tick that the world is at, as far as known. What is shown at it is extrapolated. For own avatars use `predicted`.
    double now;
    // Tick whose states have come by now, a little ago. Use it for all else. It goes forward evenly, unless ticks are counted
    // anew: where a speculative tick is taken back, or the world goes back to a save.
    double shown;
    // Tick that applies what an own avatar is asked now, where a client predicts (dcd_prediction_set). Own avatars, with what they
    // touch, are shown at it. Otherwise it is the same as `now`.
    double predicted;
    // Bound on the error of `now` that comes from clocks, seconds. It is below 0 until it is known, where no network is between,
    // and in a participant, which counts the way of what it is told as nothing.
    double clock_error;
    // Time from an input to the first state that shows it, seconds: the median of the last ones. It is below 0 before the first.
    double input_delay;
} DcdViewTime;

// DCD_DRAW_... bits: what is drawn.
typedef uint32_t DcdDrawFlags;

// Draws a point that is `size` pixels wide, however far away it is.
typedef void (*DcdDrawPointFn)(void *context, const double *at, float size, uint32_t colour);

// Draws a line between two points.
typedef void (*DcdDrawLineFn)(void *context, const double *from, const double *to, uint32_t colour);

// Draws a box along the axes of world space, from its lowest corner to its highest.
typedef void (*DcdDrawBoxFn)(void *context, const double *min, const double *max, uint32_t colour);

// Kind of a shape that is drawn: DCD_DRAWN_BOX to DCD_DRAWN_MESH. Later versions may add kinds: skip unknown ones.
typedef uint32_t DcdDrawnKind;

// Shape that is drawn, about the origin of its pose. Rounded shapes are drawn as large as they are, with edges. The struct may
// grow at its end.
typedef struct DcdDrawnShape {
    // Kind: DCD_DRAWN_BOX and so on.
    DcdDrawnKind kind;
    // Number of the mesh. In one world the same number is the same mesh for ever, so a renderer can keep what it makes of it.
    uint32_t mesh;
    // Sizes by kind, metres.
    float size[3];
    // Reserved; always 0.
    uint32_t reserved;
    // Corners of a mesh: x, y, z of each, metres.
    const float *vertices;
    // Number of corners.
    size_t vertex_count;
    // Triangles of a mesh: three corners of each, counterclockwise from outside.
    const uint32_t *triangles;
    // Number of triangles.
    size_t triangle_count;
} DcdDrawnShape;

// Draws one shape of a body at its place in the world.
typedef void (*DcdDrawShapeFn)(void *context,
                               DcdBodyId body,
                               const DcdDrawnShape *shape,
                               const DcdPose *pose,
                               uint32_t colour);

// Draws a text that begins at a point and is turned to the viewer.
typedef void (*DcdDrawTextFn)(void *context, const double *at, const char *text, uint32_t colour);

// What is drawn, and the functions that draw it. Start from DCD_DEBUG_DRAW_INIT.
//
// Points are three doubles, in metres of world space. Colours are 0xRRGGBBAA. What pointers lead to is valid during the call.
// Without draw_box or draw_shape, draw_line draws their things. What has no function otherwise is skipped.
typedef struct DcdDebugDraw {
    // Size of this struct: sizeof(DcdDebugDraw).
    uint32_t struct_size;
    // DCD_DRAW_... bits.
    DcdDrawFlags flags;
    // First argument of all functions.
    void *context;
    // Function that draws points. Null: points are skipped.
    DcdDrawPointFn draw_point;
    // Function that draws lines. Null: lines are skipped.
    DcdDrawLineFn draw_line;
    // Function that draws boxes. Null: draw_line draws them.
    DcdDrawBoxFn draw_box;
    // Function that draws shapes. Null: draw_line draws them.
    DcdDrawShapeFn draw_shape;
    // Function that draws texts. Null: texts are skipped.
    DcdDrawTextFn draw_text;
    // Lowest corner of the box to draw, metres. Movable bodies with their origin outside the box, and contacts outside it, are
    // left out.
    double min[3];
    // Highest corner of the box to draw, metres.
    double max[3];
    // Length of the line of a velocity, metres per m/s.
    float velocity_scale;
    // Length of the line of a force, metres per newton.
    float force_scale;
} DcdDebugDraw;

// Counts of what a client predicts, and of how often it was wrong. Start from DCD_PREDICTION_INIT.
typedef struct DcdPrediction {
    // Size of this struct: sizeof(DcdPrediction).
    uint32_t struct_size;
    // Number of movable bodies that are predicted now: own avatars and what is near them. 0 where nothing is predicted.
    uint32_t bodies;
    // Number of steps of the world predicted so far.
    uint64_t ticks;
    // Number of times that the world told something other than was predicted, and steps were computed again.
    uint64_t replays;
    // Number of replays by which an own avatar, or what it touches, was shown more than 2 cm off.
    uint64_t corrections;
    // Largest of these corrections, metres.
    double largest_correction;
    // Time that the predictions of the last dcd_view_time took, seconds.
    double last_frame;
    // Longest time that the predictions of one dcd_view_time took, seconds.
    double longest_frame;
} DcdPrediction;

// Id of a connection of one world with another process. 0 is null. It stays the same when the link breaks and is made anew.
typedef struct DcdConnectionId {
    // Opaque number.
    uint64_t v;
} DcdConnectionId;

// State of a connection.
typedef uint32_t DcdConnectionState;

// Connection as it is now. Start from DCD_CONNECTION_INFO_INIT. All numbers are up to half a second old.
typedef struct DcdConnectionInfo {
    // Size of this struct: sizeof(DcdConnectionInfo).
    uint32_t struct_size;
    // State: DCD_CONNECTION_CAME while the connection has the link that it came with, DCD_CONNECTION_LOST while it has none,
    // DCD_CONNECTION_BACK while it has another.
    DcdConnectionState state;
    // Role of the process at the other end, as in DcdConnectionEvent.
    DcdRole role;
    // Number of that process as a node, as in DcdConnectionEvent.
    uint32_t node;
    // Number of that process as a client, as in DcdConnectionEvent.
    uint32_t client;
    // Share of the packets sent that got lost on the way, 0 to 1.
    float loss;
    // Round trip, seconds.
    double rtt;
    // Time since the connection came, seconds.
    double age;
    // Bytes received over the connection, without those of QUIC itself.
    uint64_t bytes_in;
    // Bytes sent over the connection, without those of QUIC itself.
    uint64_t bytes_out;
    // Bytes of UDP received over the connection: those of bytes_in, and what QUIC adds, as DcdStats.udp_bytes_in.
    uint64_t udp_bytes_in;
    // Bytes of UDP sent over the connection: those of bytes_out, and what QUIC adds.
    uint64_t udp_bytes_out;
    // Messages received, dcd's own and those of programs, and datagrams.
    uint64_t messages_in;
    // Messages and datagrams sent.
    uint64_t messages_out;
    // Datagrams dropped at this end, because the link was full or nobody took them.
    uint64_t dropped;
    // Bytes that wait because the link or the other end is slow.
    uint64_t bytes_waiting;
} DcdConnectionInfo;

// Contact event: two colliders of two bodies began or ceased to touch. It is reported when either has DCD_EVENT_CONTACT, once per
// pair of colliders, whatever regions see it: two bodies of several colliders touch from the first event that begins to the last
// that ends. In a served world it is reported for avatars of this process.
typedef struct DcdContact {
    // The body made first: of the two, the one that dcd_bodies lists first. Its id is stale when it was destroyed since.
    DcdBodyId a;
    // The other body.
    DcdBodyId b;
    // User data of `a`.
    uint64_t user_a;
    // User data of `b`.
    uint64_t user_b;
    // Point of the contact, world space, metres; 0 for ends.
    double point[3];
    // Normal from a to b, of length 1; 0 for sensors and ends.
    float normal[3];
    // Speed at which the bodies approached, m/s; 0 for ends.
    float speed;
    // Kind: DCD_CONTACT_BEGAN or DCD_CONTACT_ENDED.
    uint32_t kind;
    // DCD_CONTACT_SENSOR bit, or 0.
    uint32_t flags;
    // Number of the collider of `a`, from 0, in the order of that step (dcd_collider_remove): bodies may have several.
    uint32_t collider_a;
    // Number of the collider of `b`, from 0.
    uint32_t collider_b;
    // User data of that collider of `a` (DcdBodyDef.material, DcdColliderProperties.user_data); 0 once the body is gone.
    uint64_t material_a;
    // User data of that collider of `b`; 0 once the body is gone.
    uint64_t material_b;
} DcdContact;

// Contact force event: a contact pressed harder than the force_threshold of a body with DCD_EVENT_FORCE.
typedef struct DcdContactForce {
    // The body made first, as in DcdContact.
    DcdBodyId a;
    // The other body.
    DcdBodyId b;
    // User data of `a`.
    uint64_t user_a;
    // User data of `b`.
    uint64_t user_b;
    // Sum of the forces on `b`, newtons, world axes.
    float force[3];
    // Sum of the magnitudes of these forces, newtons.
    float magnitude;
    // Number of the collider of `a`, from 0.
    uint32_t collider_a;
    // Number of the collider of `b`, from 0.
    uint32_t collider_b;
    // User data of that collider of `a`, as in DcdContact.
    uint64_t material_a;
    // User data of that collider of `b`, as in DcdContact.
    uint64_t material_b;
} DcdContactForce;

// Transfer: a body changed owner in the step. That the program put it elsewhere is not reported.
//
// In a served world, it was heard of in the step, and another region owned it than when it was heard of before. That is exact for
// both times, and leaves out what the body went through between them. Nothing is reported of bodies whose owner was not known
// before (DCD_OWNER_BY_PLACE), of bodies outside the interest, and of regions that another node computes now.
typedef struct DcdTransfer {
    // The body that changed owner.
    DcdBodyId body;
    // User data of the body.
    uint64_t user_data;
    // Region that owned the body, as in DcdRegionInfo.
    uint32_t from;
    // Region that owns the body now.
    uint32_t to;
} DcdTransfer;

// Change of a body of a served world: it appeared, is gone, or an input was refused. Bodies that were there on joining are not
// reported. An avatar that is destroyed before it has appeared is reported to appear, and then to be gone. A body that is
// gone and appears in the same step may be another one by the same id, or is altered: the world went back to a save. Look at it anew.
// In a local world, and to the server's own program, nothing is reported.
typedef struct DcdBodyChange {
    // The body; null when a refusal concerns none.
    DcdBodyId body;
    // User data of the body, from the program or from whoever made it; 0 for a body of another process that came and went between
    // two steps.
    uint64_t user_data;
    // Kind: DCD_CHANGE_APPEARED, DCD_CHANGE_REMOVED or DCD_CHANGE_REFUSED.
    uint32_t kind;
    // DCD_REFUSED_… reason of a refusal, else 0; dcd_refused_string names it.
    uint32_t reason;
} DcdBodyChange;

// Cause for which a connection is lost or gone.
typedef uint32_t DcdCause;

// Change of the state of a connection.
typedef struct DcdConnectionEvent {
    // The connection that changed.
    DcdConnectionId connection;
    // New state: DCD_CONNECTION_CAME, DCD_CONNECTION_LOST, DCD_CONNECTION_BACK or DCD_CONNECTION_GONE.
    DcdConnectionState state;
    // Role of the process that is, or was, at the other end: DCD_ROLE_SERVER, DCD_ROLE_NODE, DCD_ROLE_CLIENT, DCD_ROLE_PARTICIPANT
    // or DCD_ROLE_BUILDER.
    DcdRole role;
    // Number by which the server knows that process as a node, from 1; 0 if it is none.
    uint32_t node;
    // Number by which the server knows that process as a client, as DcdWorldInfo.client; 0 if it is none.
    uint32_t client;
    // DCD_CAUSE_... constant: why the connection is lost or gone.
    DcdCause cause;
    // Reserved; always 0.
    uint32_t reserved;
    // Cause in words, for people; empty with DCD_CAUSE_NONE. Cut to fit.
    char reason[DCD_MAX_REASON];
} DcdConnectionEvent;

// Message that the program at the other end of a connection sent by dcd_send.
typedef struct DcdMessage {
    // Connection over which the message came. Answer by it.
    DcdConnectionId connection;
    // Bytes of the message, as they were sent, at an address for any type; null when there are none.
    const void *data;
    // Number of bytes.
    size_t size;
    // Role of the sender, as in DcdConnectionEvent.
    DcdRole role;
    // Number of the sender as a node, as in DcdConnectionEvent.
    uint32_t node;
    // Number of the sender as a client, as in DcdConnectionEvent.
    uint32_t client;
    // DCD_SEND_… bits.
    uint32_t flags;
} DcdMessage;

// Joint that bore more than its strength in the step (dcd_joint_set_strength), in a local world. Whether it breaks is up to the
// program: dcd_joint_destroy breaks it.
typedef struct DcdJointOverload {
    // The joint.
    DcdJointId joint;
    // User data of the joint.
    uint64_t user_data;
    // Force on the joint's locked axes, newtons.
    float force;
    // Torque on the joint's locked axes as Rapier's solver has it, newton metres: not that about the anchor, unless this is the
    // body's centre of mass.
    float torque;
} DcdJointOverload;

// Events of the last step. Start from DCD_EVENT_VIEW_INIT. Arrays are null when their count is 0.
typedef struct DcdEventView {
    // Size of this struct: sizeof(DcdEventView).
    uint32_t struct_size;
    // DCD_EVENTS_… bits.
    uint32_t flags;
    // Number of the step in which the events happened; in a served world that of the newest tick heard of, while the events are
    // of all ticks since the call before.
    uint64_t tick;
    // Contacts that began or ended, in order of their bodies.
    const DcdContact *contacts;
    // Number of entries in `contacts`.
    size_t contact_count;
    // Contacts that pressed hard, in order of their bodies.
    const DcdContactForce *forces;
    // Number of entries in `forces`.
    size_t force_count;
    // Bodies that changed owner. In a served world, those that were heard to, in the order in which this was heard; if there are
    // more than 4096, the newest.
    const DcdTransfer *transfers;
    // Number of entries in `transfers`.
    size_t transfer_count;
    // Bodies of a served world that came and went, and refusals.
    const DcdBodyChange *changes;
    // Number of entries in `changes`.
    size_t change_count;
    // Changes of a served world's connections, in order; if there are more than 4096, the newest.
    const DcdConnectionEvent *connections;
    // Number of entries in `connections`.
    size_t connection_count;
    // Messages that programs of other processes sent to this one, in the order in which they came. Their bytes live as long as the
    // array.
    const DcdMessage *messages;
    // Number of entries in `messages`.
    size_t message_count;
    // Joints that bore more than their strength, oldest first.
    const DcdJointOverload *overloads;
    // Number of entries in `overloads`.
    size_t overload_count;
} DcdEventView;

// Point at which two bodies touch, or are about to.
typedef struct DcdContactPoint {
    // The body made first.
    DcdBodyId a;
    // The other body.
    DcdBodyId b;
    // Position in the middle between the two surfaces, world space, metres.
    double point[3];
    // Normal from a to b, of length 1.
    float normal[3];
    // Distance between the surfaces, metres, negative where they overlap.
    float separation;
    // Impulse along the normal on `b` in the last step, N s, without friction. Divided by dt it is the force.
    float impulse;
    // Number of the point's manifold among those of the two colliders: points of one manifold have one normal.
    uint32_t manifold;
    // Number of the collider of `a`, from 0.
    uint32_t collider_a;
    // Number of the collider of `b`, from 0.
    uint32_t collider_b;
    // user_data of that collider of `a`, such as the number of a material.
    uint64_t material_a;
    // user_data of that collider of `b`, such as the number of a material.
    uint64_t material_b;
} DcdContactPoint;

// Answer of DcdHooks.filter: what becomes of a pair.
typedef uint32_t DcdPairAnswer;

// Two colliders that a hook is asked about.
typedef struct DcdHookedPair {
    // The body made first.
    DcdBodyId a;
    // The other body.
    DcdBodyId b;
    // User data of `a`.
    uint64_t user_a;
    // User data of `b`.
    uint64_t user_b;
    // user_data of the collider of `a`, such as the number of a material.
    uint64_t material_a;
    // user_data of the collider of `b`, such as the number of a material.
    uint64_t material_b;
    // Number of the collider of `a`, from 0.
    uint32_t collider_a;
    // Number of the collider of `b`, from 0.
    uint32_t collider_b;
    // Pose of `a`.
    DcdPose pose_a;
    // Pose of `b`.
    DcdPose pose_b;
    // Velocity of `a`.
    DcdVelocity velocity_a;
    // Velocity of `b`.
    DcdVelocity velocity_b;
} DcdHookedPair;

// Returns whether two colliders meet: DCD_MEET_PUSH, DCD_MEET_TOUCH or DCD_MEET_NOT. Any other answer counts as DCD_MEET_PUSH, and
// nothing tells of it.
typedef DcdPairAnswer (*DcdFilterFn)(void *context, const DcdHookedPair *pair);

// Returns whether a sensor detects another collider.
typedef bool (*DcdDetectFn)(void *context, const DcdHookedPair *pair);

// Contact that is about to be solved, of one manifold: several points with one normal.
typedef struct DcdHookedContact {
    // Normal from a to b, of length 1. To be read only.
    float normal[3];
    // Least separation of the contact's points, metres, negative where they overlap. To be read only.
    float separation;
    // Number of the contact's points. To be read only.
    uint32_t points;
    // 1 at first. 0 takes the contact out of this step: the colliders touch and do not push. Any other number counts as 1.
    uint32_t enabled;
    // Friction: Coulomb coefficient, 0 or more and finite.
    float friction;
    // Restitution, 0 to 1.
    float restitution;
    // Velocity of the surface of `a` against that of `b`, world axes, m/s; 0 at first. So a conveyor belt `a` carries `b` along.
    // For a belt that is `b`, give the negative.
    float surface_velocity[3];
    // Number of the program's own that the manifold keeps while it lasts; 0 at first, and where bodies come to another region. The
    // function is called once per substep, of which a step may have several where regions meet.
    uint32_t memory;
} DcdHookedContact;

// Changes a contact before it is solved. A member that is out of its range afterwards (a friction that is NaN or below 0, a
// restitution above 1, a surface_velocity that is not finite) is left as it was, and nothing tells of it. What is to be read only is
// not read back.
typedef void (*DcdModifyFn)(void *context, const DcdHookedPair *pair, DcdHookedContact *contact);

// Functions that are asked about contacts. Start from DCD_HOOKS_INIT.
typedef struct DcdHooks {
    // Size of this struct: sizeof(DcdHooks).
    uint32_t struct_size;
    // Reserved; must be 0.
    uint32_t reserved;
    // First argument of all functions.
    void *context;
    // Function that is asked about two colliders that touch, of which one has DCD_HOOK_FILTER. Null: they push.
    DcdFilterFn filter;
    // Function that is asked about a sensor and what is in it, of which one has DCD_HOOK_DETECT. Null: the sensor detects it.
    DcdDetectFn detect;
    // Function that is asked about a contact of two colliders, of which one has DCD_HOOK_MODIFY. Null: the contact stays as it is.
    DcdModifyFn modify;
} DcdHooks;

// Ray. Start from DCD_RAY_INIT and give a direction.
typedef struct DcdRay {
    // Point where the ray starts, world space, metres.
    double origin[3];
    // Direction of the ray, of any length above 0.
    float direction[3];
    // Length of the ray, metres, above 0; INFINITY is allowed.
    float max_distance;
    // Body that the ray passes through, such as the one that looks; null for none.
    DcdBodyId exclude;
    // Groups that the ray meets, as bits, as in DcdBodyDef.groups; 0xFFFFFFFF for all.
    uint32_t mask;
    // DCD_QUERY_HOLLOW or 0.
    uint32_t flags;
} DcdRay;

// Filter: what all queries of a call overlook. Start from DCD_FILTER_INIT, which overlooks nothing.
typedef struct DcdFilter {
    // Size of this struct: sizeof(DcdFilter).
    uint32_t struct_size;
    // DCD_FILTER_… bits.
    uint32_t flags;
    // Groups that the queries belong to, as bits. Colliders whose mask meets none of them are overlooked. 0 asks no collider's
    // mask.
    uint32_t groups;
    // Groups that the queries meet, as bits; 0xFFFFFFFF for all.
    uint32_t mask;
    // Ids of the bodies that are overlooked; null when there are none.
    const DcdBodyId *exclude;
    // Number of entries in `exclude`.
    size_t exclude_count;
} DcdFilter;

// Body that a ray met.
typedef struct DcdRayHit {
    // The body; null when the ray met nothing, and then all else is 0.
    DcdBodyId body;
    // User data of the body.
    uint64_t user_data;
    // Point where the ray met the body, world space, metres.
    double point[3];
    // Normal of the body there, outward, of length 1; 0 when the ray starts inside the body.
    float normal[3];
    // Distance of that point from the origin, metres.
    float distance;
    // Number of the collider of the body, from 0.
    uint32_t collider;
    // Number of the triangle of a mesh or terrain, or of the part of a compound; else 0.
    uint32_t subshape;
    // user_data of that collider, such as the number of a material.
    uint64_t material;
} DcdRayHit;

// Shape that moves straight, and may turn on the way. Start from DCD_SHAPE_CAST_INIT and give `shape` and `motion`.
typedef struct DcdShapeCast {
    // Shape that moves, of the same world. It cannot be a mesh or terrain.
    DcdShapeId shape;
    // Pose at which the shape starts.
    DcdPose pose;
    // Way of the shape's origin, metres.
    float motion[3];
    // Turn of the shape on the way: about this axis of the world, by its length in radians. 0 is cheaper.
    float turn[3];
    // Distance from a body at which the shape counts as there, metres, 0 or more; 0 if it turns.
    float margin;
    // Groups that the shape meets, as bits; 0xFFFFFFFF for all.
    uint32_t mask;
    // Body that the shape passes through; null for none.
    DcdBodyId exclude;
    // DCD_QUERY_LEAVE or 0.
    uint32_t flags;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdShapeCast;

// First body that a moving shape met.
typedef struct DcdShapeHit {
    // The body; null when the shape met nothing, and then all else is 0.
    DcdBodyId body;
    // User data of the body.
    uint64_t user_data;
    // Point on the body, world space, metres.
    double point[3];
    // Normal of the body there, outward, of length 1.
    float normal[3];
    // Part of its way that the shape came, 0 to 1.
    float fraction;
    // Point on the shape, in its own space, metres.
    float point_on_shape[3];
    // Normal of the shape there, outward, in its own space.
    float normal_on_shape[3];
    // Number of the collider of the body, from 0.
    uint32_t collider;
    // Number of the triangle of a mesh or terrain, or of the part of a compound; else 0.
    uint32_t subshape;
    // DCD_HIT_INSIDE or 0.
    uint32_t flags;
    // Reserved; always 0.
    uint32_t reserved;
    // user_data of that collider, such as the number of a material.
    uint64_t material;
} DcdShapeHit;

// Point, to find the place nearest to it, or the bodies that it lies in. Start from DCD_POINT_QUERY_INIT.
typedef struct DcdPointQuery {
    // The point, world space, metres.
    double point[3];
    // Largest distance of a place, for dcd_project_points, metres, 0 or more; INFINITY is allowed.
    float max_distance;
    // Groups that the point meets, as bits; 0xFFFFFFFF for all.
    uint32_t mask;
    // Body that is overlooked; null for none.
    DcdBodyId exclude;
    // DCD_QUERY_HOLLOW or 0, for dcd_project_points; else 0.
    uint32_t flags;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdPointQuery;

// Place of a body nearest to a point.
typedef struct DcdPointHit {
    // The body; null when none is near enough, and then all else is 0.
    DcdBodyId body;
    // User data of the body.
    uint64_t user_data;
    // The place, world space, metres.
    double point[3];
    // Distance from the point that was asked about, metres.
    float distance;
    // Number of the collider of the body, from 0.
    uint32_t collider;
    // DCD_HIT_INSIDE or 0.
    uint32_t flags;
    // Reserved; always 0.
    uint32_t reserved;
    // user_data of that collider, such as the number of a material.
    uint64_t material;
} DcdPointHit;

// Shape at a pose, to find what overlaps it. Start from DCD_SHAPE_QUERY_INIT and give a shape.
typedef struct DcdShapeQuery {
    // The shape, of the same world. It cannot be a mesh or terrain.
    DcdShapeId shape;
    // Pose of the shape.
    DcdPose pose;
    // Body that is overlooked; null for none.
    DcdBodyId exclude;
    // Groups that the shape meets, as bits; 0xFFFFFFFF for all.
    uint32_t mask;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdShapeQuery;

// Body that overlaps a shape, a point or a box.
typedef struct DcdOverlap {
    // The body.
    DcdBodyId body;
    // User data of the body.
    uint64_t user_data;
    // Number of the collider of the body, from 0.
    uint32_t collider;
    // Reserved; always 0.
    uint32_t reserved;
    // user_data of that collider, such as the number of a material.
    uint64_t material;
} DcdOverlap;

// Box along the axes of the world (AABB), to find what overlaps it. Corners may be infinite. Start from DCD_BOX_QUERY_INIT and
// give them.
typedef struct DcdBoxQuery {
    // Lowest corner, metres.
    double min[3];
    // Highest corner, metres.
    double max[3];
    // Body that is overlooked; null for none.
    DcdBodyId exclude;
    // Groups that the box meets, as bits; 0xFFFFFFFF for all.
    uint32_t mask;
    // Reserved; must be 0.
    uint32_t reserved;
} DcdBoxQuery;

// Receives a body that a ray met; `hit` is valid during the call. Returns how far the ray goes from now on, metres: INFINITY for
// as far as it did, hit->distance to be called for nearer bodies only, 0 to end.
//
// The thread that asks calls the function. It must return normally (no longjmp, no C++ exception). Calls on worlds from within it
// give DCD_ERR_BUSY.
typedef float (*DcdRayFn)(void *context, const DcdRayHit *hit);

// Receives a body that a moving shape met; `hit` is valid during the call. Returns how much of its way the shape goes from now on:
// 1 for as much as it did, hit->fraction to be called for bodies that it meets earlier only, 0 to end. All else is as in DcdRayFn.
typedef float (*DcdShapeCastFn)(void *context, const DcdShapeHit *hit);

// Receives a body that was found; `found` is valid during the call. Returns whether to go on. All else is as in DcdRayFn.
typedef bool (*DcdOverlapFn)(void *context, const DcdOverlap *found);

// Id of an open query: rays, casts or overlaps that were submitted and whose answer was not fetched yet. 0 is null. An id is never
// given again.
typedef struct DcdQueryId {
    // Opaque number.
    uint64_t v;
} DcdQueryId;

// Region: a box of the world whose bodies one Rapier world computes. Outer faces lie at infinity.
typedef struct DcdRegionInfo {
    // Number of the region in the tree of regions. Numbers need not be dense.
    uint32_t region;
    // Number of bodies that the region owns. In a served world, of those that are known, by what dcd_body_owner says.
    uint32_t bodies;
    // Number of ghosts that the region holds, copies of bodies that its neighbours own; 0 in a served world.
    uint32_t ghosts;
    // Number of the node that computes the region, as the server numbers nodes from 1, as last told: the region may have changed
    // hands some milliseconds ago. DCD_NO_NODE in a local world, and while nobody computes it.
    uint32_t node;
    // Lowest corner, which is inside the region, metres.
    double min[3];
    // Highest corner, which is outside the region, metres.
    double max[3];
} DcdRegionInfo;

// Border between two regions.
typedef struct DcdBorderInfo {
    // Region of the lower number, as in DcdRegionInfo.
    uint32_t a;
    // Region of the higher number.
    uint32_t b;
    // Number of movable bodies that both regions hold, whoever owns them.
    uint32_t bodies;
    // Number of exchanges by which the two regions come to consensus in the next step; with DCD_COUPLING_AUTO as many as the
    // border came to need.
    uint32_t exchanges;
    // Number of contact hops across the border within which bodies live in both regions, at the side where it is more; 0 with
    // DCD_COUPLING_OWNER and DCD_COUPLING_PROXY.
    uint32_t depth;
    // Disagreement here in the last step: how far the copies of a body were from agreement, summed over the step's exchanges, m/s.
    // It is an estimate of the error that the border makes. 0 with DCD_COUPLING_OWNER and DCD_COUPLING_PROXY.
    float disagreement;
} DcdBorderInfo;

// Owner of a body: the region with authority over it. Start from DCD_OWNER_INIT.
typedef struct DcdOwner {
    // Size of this struct: sizeof(DcdOwner).
    uint32_t struct_size;
    // Region that owns the body, as in DcdRegionInfo. DCD_NO_REGION for a fixed body, which every region near it has, and for an
    // avatar that has not appeared yet. In a served world, the region that owned the body when it was last heard of: exactly,
    // unless DCD_OWNER_BY_PLACE is set.
    uint32_t region;
    // Number of the node that computes the region, as DcdRegionInfo.node.
    uint32_t node;
    // Number of regions that hold the body, its owner included; 0 in a served world, where it is not told.
    uint32_t holders;
    // DCD_OWNER_… bits. In a participant, DCD_OWNER_HERE and DCD_OWNER_HEARD may both be set.
    uint32_t flags;
} DcdOwner;

// Counters of a world. Start from DCD_STATS_INIT.
typedef struct DcdStats {
    // Size of this struct: sizeof(DcdStats).
    uint32_t struct_size;
    // Number of regions that the world is cut into.
    uint32_t regions;
    // Number of steps done; in a served world, the newest step heard of.
    uint64_t ticks;
    // Number of movable bodies.
    uint64_t bodies;
    // Number of ghosts: copies of bodies in regions that do not own them; 0 in a served world.
    uint64_t ghosts;
    // Number of times that a body changed owner in a step, ever; 0 in a served world.
    uint64_t transfers;
    // Number of copies set aside because their numbers were not finite; 0 unless something is wrong, and in a served world.
    uint64_t quarantined;
    // Number of messages with states of bodies received, ever; 0 in a local world.
    uint64_t updates;
    // Bytes received, without those of QUIC itself; 0 in a local world. A tenth of a second old.
    uint64_t bytes_in;
    // Bytes sent, without those of QUIC itself; 0 in a local world.
    uint64_t bytes_out;
    // Bytes of UDP received: those of bytes_in, and what QUIC adds; 0 in a local world. It is what a link is charged for, but for
    // 28 (IPv6: 48) bytes of headers per packet.
    uint64_t udp_bytes_in;
    // Bytes of UDP sent: those of bytes_out, and what QUIC adds; 0 in a local world.
    uint64_t udp_bytes_out;
    // Round trip to the slowest peer, seconds; 0 in a local world.
    double rtt;
    // Wall time of the last step, seconds; in a served world, of taking in what had come.
    double last_step;
    // Disagreement at the worst border in the last step: how far copies of a body in different regions were from agreement, summed
    // over its exchanges, m/s. It is an estimate of the error that borders make. 0 with DCD_COUPLING_OWNER and DCD_COUPLING_PROXY,
    // and in a served world.
    float disagreement;
    // Number of exchanges between regions in the last step, at the border that took most; 0 in a world of one region and in a
    // served one.
    uint32_t exchanges;
} DcdStats;

// Time that the last step took, in seconds by phase, and what was computed in it. These are sums over all regions, which compute
// side by side, so times may be more than DcdStats.last_step. Start from DCD_PROFILE_INIT. The struct may grow at its end.
typedef struct DcdProfile {
    // Size of this struct: sizeof(DcdProfile).
    uint32_t struct_size;
    // Reserved; always 0.
    uint32_t reserved;
    // Time of Rapier's steps, all phases, seconds.
    double rapier;
    // Time of finding pairs whose boxes touch, seconds; 0, as the next four are, in a library that was built without the feature
    // `profiler`.
    double broad_phase;
    // Time of finding contacts, seconds.
    double narrow_phase;
    // Time of keeping islands, and of putting bodies to sleep, seconds.
    double islands;
    // Time of solving contacts and joints, and of moving bodies, seconds.
    double solver;
    // Time of sweeping fast bodies, seconds.
    double ccd;
    // Time of exchanging messages between regions, seconds: wall time.
    double border;
    // Number of pairs of colliders near enough for contacts. Pairs that regions share count in each, as in all that follows.
    uint64_t contact_pairs;
    // Number of points of contact that were solved.
    uint64_t contacts;
    // Number of bodies that were awake.
    uint64_t awake;
    // Number of joints, awake or not.
    uint64_t joints;
    // Number of islands that are awake now: groups of bodies that touch or are tied.
    uint64_t islands_awake;
    // Memory that bodies, colliders, contacts and joints take, roughly, bytes. That of shapes, and of what is kept for the next
    // step, does not count.
    uint64_t memory;
} DcdProfile;

// Id of a checkpoint: a local world as it was between two steps. 0 is null. An id is never given again.
typedef struct DcdCheckpointId {
    // Opaque number.
    uint64_t v;
} DcdCheckpointId;

// Viewpoint: a place that a world is looked at from.
typedef struct DcdViewpoint {
    // Position, world space, metres.
    double at[3];
    // Distance that is looked, metres, 0 or more: regions within it are computed in full.
    double radius;
} DcdViewpoint;

// Report of what fidelity saved and what it cost, as far as is known. Start from DCD_FIDELITY_REPORT_INIT. The struct may grow at
// its end.
typedef struct DcdFidelityReport {
    // Size of this struct: sizeof(DcdFidelityReport).
    uint32_t struct_size;
    // Mean error of a body's velocity per step against a model four times as fine, m/s, by audits of the last steps; 0 before the
    // first audit, and where all is computed in full.
    float error;
    // Lower end of the 95 % confidence interval of `error`, m/s.
    float low95;
    // Upper end of the 95 % confidence interval of `error`, m/s; infinite before two audits, and 0 where all is computed in full.
    float high95;
    // Time of regions' steps over the time that they would have taken had each been stepped in every step, as reckoned.
    double share_of_full_time;
    // Number of audits so far.
    uint64_t audits;
    // Number of steps that took longer than the budget, since the first second.
    uint64_t overruns;
    // Numbers of regions that are stepped in every step, in every second one, and in every fourth.
    uint32_t levels[3];
    // Reserved; always 0.
    uint32_t reserved;
} DcdFidelityReport;

// Force and torque on a body in every step, in world axes.
typedef struct DcdForce {
    // Force at the centre of mass, newtons.
    float force[3];
    // Torque, newton metres.
    float torque[3];
} DcdForce;

// Logs nothing.
#define DCD_LOG_OFF 0

// Logs failures: something failed.
#define DCD_LOG_ERROR 1

// Logs warnings: something is not as it should be.
#define DCD_LOG_WARN 2

// Logs milestones: processes that join and leave, views, failures of nodes.
#define DCD_LOG_INFO 3

// Logs every step of joins and view changes, and every failed call.
#define DCD_LOG_DEBUG 4

// Logs everything.
#define DCD_LOG_TRACE 5

// Local: the process computes all of the world.
#define DCD_ROLE_LOCAL 0

// Client: hosts avatars in the world, which others compute.
#define DCD_ROLE_CLIENT 1

// Participant: hosts avatars in the world, and computes a share of it.
#define DCD_ROLE_PARTICIPANT 2

// Server: holds the world, decides which process computes what, and lets others in.
#define DCD_ROLE_SERVER 3

// Node: computes a share of the world.
#define DCD_ROLE_NODE 4

// Builder: a client that hosts avatars and may also change what is the world's own, as the server's program does.
#define DCD_ROLE_BUILDER 5

// The call succeeded.
#define DCD_OK 0

// A pointer or a handle that must be given is null.
#define DCD_ERR_NULL (-1)

// A handle is stale: what it named was destroyed, or belongs to another world.
#define DCD_ERR_STALE_ID (-2)

// A struct_size is not that of this library's struct. Start from the DCD_…_INIT macro.
#define DCD_ERR_STRUCT (-3)

// A value is out of range: NaN, a negative size, an unknown constant, a count above DCD_MAX_ITEMS.
#define DCD_ERR_ARGUMENT (-4)

// The caller's memory is too small. The size needed was written. A call that asks for the size, by null with room for 0, returns
// DCD_OK.
#define DCD_ERR_SMALL_BUFFER (-5)

// The call cannot be done now: it comes from within a function that the library calls (see Threads), where worlds may not be used;
// or, for dcd_step_begin, a step that was begun is not waited for yet; or, for messages, too many wait to be sent.
#define DCD_ERR_BUSY (-6)

// Nobody answered in time.
#define DCD_ERR_TIMEOUT (-8)

// The server refuses, or the link to it is gone.
#define DCD_ERR_NETWORK (-9)

// Versions do not fit: the header that the program was compiled with and the library it runs with, or the build that wrote a
// snapshot and this one.
#define DCD_ERR_VERSION (-10)

// The library has a bug. The world that was called can only be destroyed; other worlds go on.
#define DCD_ERR_PANIC (-11)

// The role of this world (DcdWorldInfo.role) cannot do this. The message names the role.
#define DCD_ERR_UNSUPPORTED (-12)

// A file cannot be read or written.
#define DCD_ERR_IO (-13)

// The system or the world has no more of something: threads, ids.
#define DCD_ERR_LIMIT (-14)

// The body never moves: ground and walls.
#define DCD_FIXED 0

// The body moves by forces.
#define DCD_DYNAMIC 1

// The body moves at the velocity that the program gives it, whatever it meets: doors and lifts.
#define DCD_KINEMATIC 2

// The body moves to the pose that dcd_body_set_target gives it, whatever it meets: animated limbs. Not in a served world.
#define DCD_KINEMATIC_POSE 3

// Average: (a + b) / 2.
#define DCD_COMBINE_AVERAGE 0

// Minimum: ice makes everything slippery.
#define DCD_COMBINE_MIN 1

// Product: a * b.
#define DCD_COMBINE_MULTIPLY 2

// Maximum: rubber makes everything stick.
#define DCD_COMBINE_MAX 3

// Sum: a + b, at most 1.
#define DCD_COMBINE_SUM 4

// Geometric mean: the square root of a * b.
#define DCD_COMBINE_GEOMETRIC_MEAN 5

// The scene's coupling, else DCD_COUPLING_AUTO.
#define DCD_COUPLING_DEFAULT 0

// Ghosts of a neighbour's bodies push and are not pushed. The world gains energy and drops stacks: use it to compare with.
#define DCD_COUPLING_PROXY 1

// The owner overwrites ghosts after each step. It is the cheapest coupling. Momentum is not conserved across a border.
#define DCD_COUPLING_OWNER 2

// Bodies near a border live in both regions. Each copy has a part of the mass (mass splitting), and all copies take their mean
// velocity (consensus).
#define DCD_COUPLING_OVERLAP 3

// Both regions solve with whole copies, and bodies that stay in touch (an island) move whole to one region. An island above
// island_limit is treated as with DCD_COUPLING_OVERLAP.
#define DCD_COUPLING_ISLAND 4

// As DCD_COUPLING_ISLAND, with as many exchanges at each border as the disagreement of its copies asks for.
#define DCD_COUPLING_AUTO 5

// The scene's preset, else DCD_PRESET_GAME.
#define DCD_PRESET_DEFAULT 0

// Speed first: at most 2 exchanges, islands of up to 256 bodies whole, a tolerance of 0.1 m/s.
#define DCD_PRESET_DRAFT 1

// For games: at most 4 exchanges, every island whole, a tolerance of 0.03 m/s.
#define DCD_PRESET_GAME 2

// Accuracy first: at most 4 exchanges, a depth of 3 hops, every island whole, a tolerance of 0.01 m/s.
#define DCD_PRESET_PRECISE 3

// A box; `size` is half of its edges.
#define DCD_SHAPE_BOX 0

// A ball; size[0] is its radius.
#define DCD_SHAPE_SPHERE 1

// A capsule along y; size[0] is its radius, size[1] half of its length without the caps.
#define DCD_SHAPE_CAPSULE 2

// A cylinder along y; size[0] is its radius, size[1] half of its height.
#define DCD_SHAPE_CYLINDER 3

// A cone whose tip is at +y; size[0] is the radius of its base, size[1] half of its height.
#define DCD_SHAPE_CONE 4

// A convex hull: vertices and triangles.
#define DCD_SHAPE_HULL 5

// A mesh: vertices and triangles.
#define DCD_SHAPE_MESH 6

// Terrain: `rows` x `columns` heights, stretched by `size`, and the vertices and triangles of its surface.
#define DCD_SHAPE_HEIGHTFIELD 7

// A compound: several shapes, `parts` of them.
#define DCD_SHAPE_COMPOUND 8

// A half-space: all below the plane y = 0.
#define DCD_SHAPE_HALF_SPACE 9

// Lines between vertices, as triangles of which two corners are the same.
#define DCD_SHAPE_LINES 10

// Voxels: filled cells of a grid, with edges `size`, and the vertices and triangles of their surface.
#define DCD_SHAPE_VOXELS 11

// Lets nothing free: the frames stay together. It has no axis of its own.
#define DCD_JOINT_FIXED 0

// Lets the bodies turn about the frames' x axis, as hinges and wheels do. Its axis is DCD_AXIS_TURN_X.
#define DCD_JOINT_REVOLUTE 1

// Lets the bodies slide along the frames' x axis, as lifts and pistons do. Its axis is DCD_AXIS_X.
#define DCD_JOINT_PRISMATIC 2

// Lets the bodies turn about every axis, as shoulders do. Its axes are DCD_AXIS_TURN_X, DCD_AXIS_TURN_Y and DCD_AXIS_TURN_Z, each
// with the same limit and motor.
#define DCD_JOINT_SPHERICAL 3

// Lets everything free up to a distance of the frames' origins. It needs a limit of DCD_AXIS_X from 0 to that length.
#define DCD_JOINT_ROPE 4

// Lets everything free; a spring pulls the frames' origins to a distance. It needs a motor of DCD_AXIS_X, whose position is the
// length at rest. Take DCD_MOTOR_FORCE to give stiffness in N/m.
#define DCD_JOINT_SPRING 5

// Lets free what DcdJointDef.locked does not lock. It has no axes of its own: dcd_joint_set_limit and dcd_joint_set_motor take
// any.
#define DCD_JOINT_GENERIC 6

// Movement along x: metres, m/s, newtons.
#define DCD_AXIS_X 0

// Movement along y: metres, m/s, newtons.
#define DCD_AXIS_Y 1

// Movement along z: metres, m/s, newtons.
#define DCD_AXIS_Z 2

// Turning about x: radians, rad/s, newton metres.
#define DCD_AXIS_TURN_X 3

// Turning about y: radians, rad/s, newton metres.
#define DCD_AXIS_TURN_Y 4

// Turning about z: radians, rad/s, newton metres.
#define DCD_AXIS_TURN_Z 5

// Stiffness and damping are per unit of mass, so that heavy and light bodies move alike: stiffness in 1/s², damping in 1/s.
#define DCD_MOTOR_ACCELERATION 0

// Stiffness and damping are not per unit of mass: stiffness in N/m or N m/rad, damping in N s/m or N m s/rad.
#define DCD_MOTOR_FORCE 1

// One friction for each group of up to four points of contact, and one that brakes their turning: Rapier's default, the faster one.
#define DCD_FRICTION_SIMPLIFIED 0

// Friction at each point of contact. It keeps the momentum of crowds at borders better, and costs more.
#define DCD_FRICTION_COULOMB 1

// The pose: a DcdPose.
#define DCD_FIELD_POSE 0

// The velocity: a DcdVelocity.
#define DCD_FIELD_VELOCITY 1

// The user data: a uint64_t.
#define DCD_FIELD_USER_DATA 2

// The force and torque: a DcdForce, as dcd_body_set_force sets it.
#define DCD_FIELD_FORCE 3

// The kinematic target: a DcdPose, as dcd_body_set_target takes it. It can only be written.
#define DCD_FIELD_TARGET 4

// Draws bodies by their shapes, in the colour of the region that owns them, greyed while they sleep. Fixed bodies are grey,
// sensors faint.
#define DCD_DRAW_SHAPES 1

// Draws the boxes (AABBs) around movable bodies.
#define DCD_DRAW_AABBS 2

// Draws the swept AABBs of movable bodies: the boxes around all that they may reach in the next three steps, by which regions
// predict contacts across borders.
#define DCD_DRAW_SWEPT_AABBS 4

// Draws centres of mass, as points.
#define DCD_DRAW_CENTRES_OF_MASS 8

// Draws regions, as boxes within the bounds of the world.
#define DCD_DRAW_BORDERS 16

// Draws ghosts, copies of bodies in regions that do not own them, as boxes in the colour of the region that holds them.
#define DCD_DRAW_GHOSTS 32

// Draws contacts, as points, with their forces as lines.
#define DCD_DRAW_CONTACTS 64

// Draws joints, as lines from the one body to the joint and on to the other.
#define DCD_DRAW_JOINTS 128

// Draws linear velocities, as lines.
#define DCD_DRAW_VELOCITIES 256

// Draws avatars of clients, as points: white if they are this process's own.
#define DCD_DRAW_AVATARS 512

// Draws the ids of movable bodies, as text.
#define DCD_DRAW_LABELS 1024

// Draws all of it.
#define DCD_DRAW_ALL 2047

// A box; `size` is half of its edges.
#define DCD_DRAWN_BOX 0

// A sphere; size[0] is its radius.
#define DCD_DRAWN_SPHERE 1

// A capsule along y; size[0] is its radius, size[1] half of its length without the caps.
#define DCD_DRAWN_CAPSULE 2

// A cylinder along y; size[0] is its radius, size[1] half of its height.
#define DCD_DRAWN_CYLINDER 3

// A cone whose tip is at +y; size[0] is the radius of its base, size[1] half of its height.
#define DCD_DRAWN_CONE 4

// A half-space: all below the plane y = 0.
#define DCD_DRAWN_HALF_SPACE 5

// A mesh of triangles, or of lines, which are triangles of which two corners are the same.
#define DCD_DRAWN_MESH 6

// The connection is new, and has a link.
#define DCD_CONNECTION_CAME 1

// The link of the connection broke. The process at the other end is waited for: half a minute, as a rule, and for a server as long
// as the world goes on.
#define DCD_CONNECTION_LOST 2

// The connection has a link again.
#define DCD_CONNECTION_BACK 3

// The connection is over, and its id is stale.
#define DCD_CONNECTION_GONE 4

// No cause: the connection came, or is back.
#define DCD_CAUSE_NONE 0

// The other process left by itself, or this process did.
#define DCD_CAUSE_LEFT 1

// The server's program sent the other process away (dcd_disconnect), or this process.
#define DCD_CAUSE_SENT_AWAY 2

// Nothing is heard of the other process: it was killed, hangs, or is cut off.
#define DCD_CAUSE_BROKEN 3

// One of the two processes said what it may not, or is not what the other takes it for, such as a process of another version.
#define DCD_CAUSE_REFUSED 4

// The world has ended.
#define DCD_CAUSE_WORLD_ENDED 5

// A newer link took the place of this one, or another process with the same identity did.
#define DCD_CAUSE_REPLACED 6

// The other process reads too slowly.
#define DCD_CAUSE_SLOW 7

// One of the two processes does not need the connection any more for what it does for the world, such as when another node leads.
#define DCD_CAUSE_UNNEEDED 8

// A fault of dcd ended this process's part in the world.
#define DCD_CAUSE_FAILED 9

// The two colliders touch and push each other, as without hooks.
#define DCD_MEET_PUSH 0

// The two colliders touch, which dcd_events reports, and do not push.
#define DCD_MEET_TOUCH 1

// The two colliders pass through each other, and nothing is reported.
#define DCD_MEET_NOT 2

// The scene's fidelity, else DCD_FIDELITY_OFF.
#define DCD_FIDELITY_DEFAULT 0

// All of the world is computed in full, in every step.
#define DCD_FIDELITY_OFF 1

// As DCD_FIDELITY_TOLERANCE of 0.33 m/s.
#define DCD_FIDELITY_AUTO 2

// What is looked at is computed in full. All else is computed as seldom as keeps the mean error of a body's velocity per step
// below DcdWorldDef.fidelity_limit, m/s. The result is the same with any number of threads.
#define DCD_FIDELITY_TOLERANCE 3

// As much is computed in full as fits into DcdWorldDef.fidelity_limit, milliseconds per step, what is looked at before all else.
// It depends on the time that steps take, so no two runs are the same; a recording keeps what was chosen (dcd_record).
#define DCD_FIDELITY_BUDGET 4

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the version of the running library as major * 1000000 + minor * 1000 + patch. DCD_VERSION is the version of the header;
// dcd_version_check() compares the two.
DCD_API uint32_t dcd_version(void);

// Returns the version of the running library as text, such as "0.1.0". The text lives as long as the program.
DCD_API const char *dcd_version_string(void);

// Returns the name of a status, such as "DCD_ERR_NULL", or "(no DCD status)" for other numbers. The text lives as long as the
// program.
DCD_API const char *dcd_status_string(DcdStatus status);

// Returns the name of a reason for a refusal (DcdBodyChange.reason), such as "DCD_REFUSED_TOO_FAR", or "(no DCD reason)" for other
// numbers. The text lives as long as the program.
DCD_API
const char *dcd_refused_string(uint32_t reason);

// Copies the message of the calling thread's last failed call: the function, the cause and the remedy. The call writes at most
// `cap` bytes to `buf`, NUL included, and cuts a longer message. Calls that succeed leave the message as it is.
//
// Returns the length of the whole message without NUL, 0 if no call failed yet. To ask for the length alone, `buf` may be null.
DCD_API size_t dcd_last_error(char *buf, size_t cap);

// Sends log lines up to the level `most` to `function`, with `user` as its first argument. A null function turns the log off. When
// this call returns, the former function is not running and will not be called again.
//
// One function serves the whole process.
// Errors: DCD_ERR_ARGUMENT (an unknown level), DCD_ERR_BUSY (called from within the function).
DCD_API
DcdStatus dcd_log_set(DcdLogFn function,
                      void *user,
                      DcdLogLevel most);

// Sets the function that is called where the library finds a bug of its own: an assertion that fails, or a panic. Use it to stop
// in a debugger, or to write a report with a stack trace.
//
// The function runs on the thread and stack where the bug happens, before the call that met it returns DCD_ERR_PANIC. Without a
// function, and after a null one, the library writes a line about the bug to stderr. When this call returns, the former function
// is not running and will not be called again.
//
// One function serves the whole process, also for panics of the program's own parts in Rust. Any thread may call it, several
// threads at a time. It must return normally or end the process (no longjmp, no C++ exception). Calls on worlds from within it
// give DCD_ERR_BUSY.
// Errors: DCD_ERR_BUSY (called from within a function that the library calls).
DCD_API DcdStatus dcd_bug_set(DcdBugFn function, void *context);

// Sets the functions by which the library allocates all of its memory, from now to the end of the process. Call it once, before
// any other function of the library.
//
// Any thread may call the functions, several threads at a time, also from within every call of the library. They must return
// normally and call nothing of the library. The library must have been built with the feature: cargo build -p dcd-ffi --release
// --features allocator.
// Errors: DCD_ERR_NULL (a function), DCD_ERR_BUSY (the library has allocated already), DCD_ERR_UNSUPPORTED (built without the
// feature).
DCD_API DcdStatus dcd_allocator_set(DcdAllocateFn allocate, DcdFreeFn free, void *context);

// Creates an empty local world, which this process computes alone. Destroy it with dcd_world_destroy.
//
// `def` and its `cuts` are read during the call. `out` receives the handle.
// Errors: DCD_ERR_NULL, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT (a member out of range), DCD_ERR_LIMIT (no threads).
DCD_API DcdStatus dcd_world_create(const DcdWorldDef *def, DcdWorld *out);

// Creates a local world from a scene: a scene of the library ("tower", "pile", "chain" …) or a file whose name ends in .toml,
// .xml, .mjcf or .urdf. Body i of the scene is dcd_body_at(world, i).
//
// `params` points to `param_count` texts "name=value" that change parameters of the scene, such as "n=100". It may be null when
// there are none. Of `def`, only threads, regions, user_data and the members after user_data count; the scene says the rest. A
// null `def` is DCD_WORLD_DEF_INIT. Everything is read during the call.
// Errors:
// - As dcd_world_create.
// - DCD_ERR_ARGUMENT: an unknown scene or parameter, or a wrong file; the message names the line.
// - DCD_ERR_IO: the file cannot be read.
DCD_API
DcdStatus dcd_world_open_scene(const char *name_or_path,
                               const char *const *params,
                               size_t param_count,
                               const DcdWorldDef *def,
                               DcdWorld *out);

// Destroys a local world with everything in it, or leaves a served one, where the avatars of this process wait for its return. The
// world's handles become stale, and what dcd_state_view and dcd_events lent is freed.
//
// The call waits for a call that runs on the world in another thread. Calls that wait behind it find the world gone. A recording
// ends, and whether it is whole is only logged (dcd_log_set): call dcd_record_stop first in a local world.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice), DCD_ERR_BUSY.
DCD_API
DcdStatus dcd_world_destroy(DcdWorld world);

// Returns whether the handle names a world. It never waits.
DCD_API bool dcd_world_is_valid(DcdWorld world);

// Reads the role, tick and settings of a world.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_world_info(DcdWorld world, DcdWorldInfo *out);

// Joins a world as a client. A server holds the world, and nodes compute it. The call waits until the server has told the whole
// world, or what is near of it.
//
// The server tells the world as it is on its record: up to half a second old (two seconds more where the server has just gone on
// with a stored world). Until the first states have come from the nodes, the world is at tick 0, and who computes what is not
// known. The world need not have nodes yet: it stands still until it has.
//
// The handle is used like that of a local world, with these differences:
// - Avatars. dcd_body_create makes an avatar, a dynamic or kinematic body of the client's own. Its id is valid at once, and the
//   body stands where the client put it. DCD_CHANGE_APPEARED tells that it is in the world. DCD_CHANGE_REFUSED tells that it is not to
//   be, and then its id is stale.
// - Input. dcd_body_set_velocity sets the speed of an avatar, and dcd_body_set_pose lets it jump. The next dcd_step sends this
//   input. The server may set a limit to speed, and refuse by DCD_CHANGE_REFUSED.
// - Steps. dcd_step takes in what has come since the last, and returns at once: call it as often as dt says.
// - Lost server. A server that is out of reach is dialled again for half a minute (DcdClientDef.give_up_ms). Meanwhile the world
//   goes on as long as nodes compute it, and avatars can be moved. Avatars that are created or destroyed meanwhile are so once the
//   server is back. After that time, or when the world has ended or its server is back with another one, each dcd_step returns DCD_ERR_NETWORK. The world can still be
//   read, and must be destroyed.
// - Events. The bodies that are there on joining are not reported: list them once by dcd_bodies, and follow dcd_events from then
//   on. Contacts are reported of the client's own avatars, if these ask for them.
// - Bodies. They are where they were when last heard of, some ticks ago. Bodies of others can only be read.
// - Unsupported. Joints, forces and impulses, sleep, dcd_borders, dcd_state_hash and queries return DCD_ERR_UNSUPPORTED, except
//   for queries that are submitted (dcd_cast_rays_submit, dcd_cast_shapes_submit, dcd_overlap_shapes_submit and the like).
// - Leaving. dcd_world_destroy leaves in order. The avatars leave with the client, and come back when it joins with the same
//   identity file.
//
// `def` and its texts are read during the call. The library keeps threads of its own until the world is destroyed.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a malformed address or token, or a token for another role.
// - DCD_ERR_TIMEOUT: nobody answers.
// - DCD_ERR_NETWORK: the server refuses (a used or expired token, another version) or cannot be reached.
// - DCD_ERR_IO: the identity file.
// - DCD_ERR_LIMIT: no threads.
DCD_API
DcdStatus dcd_client_connect(const DcdClientDef *def,
                             DcdWorld *out);

// Joins a world as a participant: a client, as dcd_client_connect makes it, whose process also computes a share of the world.
//
// Threads of the library compute the share, whether or not the program calls dcd_step. dcd_world_destroy first hands the share to
// the other nodes, which may take some seconds. A process that ends without it is found dead and replaced.
// Errors: as dcd_client_connect, and DCD_ERR_ARGUMENT (threads out of range).
DCD_API DcdStatus dcd_participant_join(const DcdParticipantDef *def, DcdWorld *out);

// Lists the avatars that this process hosts, oldest first: those that it made, in the world or on their way, and those that an
// earlier stay left behind. A local world has none.
//
// Avatars of an earlier stay are in the world on joining, and then no DCD_CHANGE_APPEARED tells of them. Where the process that
// computed them had not let go of them yet, they come back soon after joining (DCD_CHANGE_APPEARED).
//
// Writes the ids to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the
// number.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
DCD_API DcdStatus dcd_own_avatars(DcdWorld world, DcdBodyId *out, size_t cap, size_t *count);

// Creates a server, which holds a world, decides which node computes what, and lets clients in. It computes nothing itself: the
// world begins with the nodes that join it (dcd_node_join, dcd_participant_join, or `dcd node` on other machines).
//
// The server works on threads of the library, whether or not the program calls dcd_step. dcd_step says whether all is well, and
// takes in what came for the program.
// - Changing the world. The program may make, move and destroy bodies by the handle, and tie new ones (dcd_bodies_create,
//   dcd_joint_create). What it did since the last dcd_step is sent with the next, is on record before anybody hears of it, and is
//   computed alike by all nodes.
// - Reading bodies. Bodies are read from the record: as nodes last told, at most half a second ago. To see them move, join the
//   world, also from the same process.
// - Queries. The nodes answer what is submitted (dcd_cast_rays_submit and the like), after what the program did before.
// - Events. dcd_events reports connections, messages, and the contacts of all bodies that ask for them, but for some while nodes
//   join or leave.
// - Ending. dcd_world_destroy ends the world for all, and so does `dcd end`. After dcd_server_suspend, or when the process ends
//   without dcd_world_destroy, a server that is made in the same way goes on with the world.
// - Folder. It keeps the server's keys (authority.pem), the list of used tokens (joins.log), locks, and the world (world.redb).
//
// `def` and what it points to are read during the call.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a member out of range, an unknown scene, or a stored world that is another one.
// - DCD_ERR_IO: the scene's file or the folder, also while another server uses the folder.
// - DCD_ERR_NETWORK: an address cannot be listened at.
// - DCD_ERR_LIMIT: no threads.
DCD_API DcdStatus dcd_server_create(const DcdServerDef *def, DcdWorld *out);

// Stops a server without ending its world. What is known of the world is written to the data folder. Nodes compute on. All
// processes dial a server that is made in the same way: nodes and participants without end, clients for half a minute
// (give_up_ms). From here on dcd_step fails with DCD_ERR_NETWORK; dcd_world_destroy frees the handle.
//
// Errors: DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (the world is not a server).
DCD_API DcdStatus dcd_server_suspend(DcdWorld world);

// Mints a token that lets one process join this server as `role`: DCD_ROLE_CLIENT, DCD_ROLE_BUILDER, DCD_ROLE_PARTICIPANT or
// DCD_ROLE_NODE. A builder joins by dcd_client_connect, and may change what is the world's own. The token can be used once, within
// `valid_seconds` (1 to 31,536,000).
//
// Writes the token to `buf` of `cap` bytes with a NUL, and its size with NUL to `needed`. With `cap` 0, `buf` may be null, to ask
// for the size: 512 bytes are always enough, and asking mints none.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER.
// - DCD_ERR_ARGUMENT: another role or time.
// - DCD_ERR_IO: the server's folder.
// - DCD_ERR_UNSUPPORTED: the world is not a server.
DCD_API
DcdStatus dcd_token_create(DcdWorld world,
                           DcdRole role,
                           uint32_t valid_seconds,
                           char *buf,
                           size_t cap,
                           size_t *needed);

// Writes the address at which a server or a node listens, such as "127.0.0.1:7420", to `buf` of `cap` bytes with a NUL, and its
// size with NUL to `needed`. With `cap` 0, `buf` may be null, to ask for the size.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`needed` is written all the same, `buf` is not),
// DCD_ERR_UNSUPPORTED (a world of another role).
DCD_API DcdStatus dcd_address(DcdWorld world, char *buf, size_t cap, size_t *needed);

// Writes the address at which a server, a node or a participant answers with its metrics, such as "127.0.0.1:9420", to `buf` of
// `cap` bytes with a NUL, and its size with NUL to `needed`. With `cap` 0, `buf` may be null, to ask for the size.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`needed` is written all the same, `buf` is not),
// DCD_ERR_UNSUPPORTED (`metrics` of the world's definition was null).
DCD_API DcdStatus dcd_metrics_address(DcdWorld world, char *buf, size_t cap, size_t *needed);

// Joins a world as a node: this process computes a share of the world. The call returns once the server has let the node in. The
// share comes when the server gives it one.
//
// The node works on threads of the library, whether or not the program calls dcd_step, which does what it does for a server. While
// the server is out of reach the node computes on, and waits for it without end (DcdNodeDef.give_up_ms).
//
// The handle serves dcd_step, dcd_poll, dcd_events, dcd_stats, connections and messages as a server's does. It has no bodies, no
// tokens and no dcd_disconnect: to see the world too, use dcd_participant_join. dcd_world_destroy first hands the share to other
// nodes, which may take some seconds.
// Errors: as dcd_participant_join, and DCD_ERR_ARGUMENT (a malformed `listen` or `advertise`).
DCD_API
DcdStatus dcd_node_join(const DcdNodeDef *def,
                        DcdWorld *out);

// Makes a box around its origin. `half` holds half of its edges along x, y, z, metres, at least DCD_MIN_SIZE.
//
// This and the other shape functions copy what they read, and write the new handle to `out`. A shape belongs to its world. Bodies
// keep what they need of it, so it may be destroyed before them.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (a size out of range).
DCD_API DcdStatus dcd_shape_box(DcdWorld world, const float *half, DcdShapeId *out);

// Makes a ball of `radius` metres around its origin. Errors: as dcd_shape_box.
DCD_API DcdStatus dcd_shape_sphere(DcdWorld world, float radius, DcdShapeId *out);

// Makes a capsule along y: a cylinder of height 2 × `half_height` with a half ball of `radius` at either end, metres. Errors: as
// dcd_shape_box.
DCD_API DcdStatus dcd_shape_capsule(DcdWorld world, float half_height, float radius, DcdShapeId *out);

// Makes a cylinder of `radius` along y, from -half_height to half_height, metres. Errors: as dcd_shape_box.
DCD_API DcdStatus dcd_shape_cylinder(DcdWorld world, float half_height, float radius, DcdShapeId *out);

// Makes a cone along y, with its base of `radius` at -half_height and its tip at half_height, metres. Errors: as dcd_shape_box.
DCD_API DcdStatus dcd_shape_cone(DcdWorld world, float half_height, float radius, DcdShapeId *out);

// Makes the convex hull of `count` points. `xyz` holds 3 × count floats (x, y, z, x, y, z …), metres. There must be at least 4
// points, not all in a plane, that reach over DCD_MIN_SIZE along each axis. Points that hardly stand out may be left out: the hull
// has at least 99 % of the volume of all.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (points out of range or that span no volume).
DCD_API
DcdStatus dcd_shape_hull(DcdWorld world,
                         const float *xyz,
                         size_t count,
                         DcdShapeId *out);

// Makes a mesh of `triangle_count` triangles. `xyz` holds 3 × vertex_count floats, metres. `indices` holds 3 × triangle_count
// indices: each triangle has three indices below `vertex_count`, counter-clockwise seen from outside. Triangles without area are
// left out.
//
// A `one_sided` mesh bears what is outside, and lets pass what comes from inside, at its triangles that run clockwise, too. What rolls
// from triangle to triangle on it is not slowed by their edges. Any other mesh bears what is on either side, and its edges slow what
// rolls over them by some hundredths.
//
// A mesh is hollow, and has mass by density only if it is closed: use it for fixed bodies, or give them DcdBodyDef.mass.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (vertices out of range, no triangle with an area, or an index
// past the vertices).
DCD_API
DcdStatus dcd_shape_mesh(DcdWorld world,
                         const float *xyz,
                         size_t vertex_count,
                         const uint32_t *indices,
                         size_t triangle_count,
                         bool one_sided,
                         DcdShapeId *out);

// Makes terrain in the x-z plane around its origin. `heights` holds `rows` heights along z times `columns` along x, metres, at
// heights[row + column * rows]. `scale` stretches the terrain: the whole is scale[0] by scale[2] metres, and heights are times
// scale[1]. Use it for fixed bodies: it has no mass by density. It bears what is above it. What rolls from triangle to triangle is
// not slowed by their edges.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (fewer than 2 rows or columns, heights out of range, or a scale
// below DCD_MIN_SIZE).
DCD_API
DcdStatus dcd_shape_heightfield(DcdWorld world,
                                const float *heights,
                                size_t rows,
                                size_t columns,
                                const float *scale,
                                DcdShapeId *out);

// Makes a half-space: all behind the plane through its origin from which `normal` points away, without end. `normal` has any
// length above 0. Use it as ground for fixed bodies, in which nothing falls through: it has no mass and no edge.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (a normal out of range or without length).
DCD_API DcdStatus dcd_shape_half_space(DcdWorld world, const float *normal, DcdShapeId *out);

// Makes a line from `a` to `b`, three floats each, metres: a wire, an edge. It has no mass by density: use it for fixed bodies, or
// give them DcdBodyDef.mass.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT (points out of range, or nearer to one another than
// DCD_MIN_SIZE).
DCD_API
DcdStatus dcd_shape_segment(DcdWorld world,
                            const float *a,
                            const float *b,
                            DcdShapeId *out);

// Makes a rounded box, cylinder, cone or hull: another shape grown by `border` metres on all sides, with edges and corners of that
// radius (DcdShapeInfo.border). Rounded shapes roll smoothly over their edges, and rounded hulls touch at more than a corner.
//
// The other shape may be destroyed afterwards.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT (a border below DCD_MIN_SIZE or out of range, or
// another kind of shape, also one that is round already).
DCD_API
DcdStatus dcd_shape_round(DcdWorld world,
                          DcdShapeId shape,
                          float border,
                          DcdShapeId *out);

// Makes a compound: one shape of `count` others, part i at frames[i]. Parts must be simple: no mesh, terrain or compound.
//
// `parts` and `frames` have `count` entries, at least one. The parts may be destroyed afterwards.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or a part), DCD_ERR_ARGUMENT (no part, a part that is not simple, or a frame that
// is not finite or no rotation).
DCD_API
DcdStatus dcd_shape_compound(DcdWorld world,
                             const DcdShapeId *parts,
                             const DcdFrame *frames,
                             size_t count,
                             DcdShapeId *out);

// Makes a shape that is another one stretched along its own axes by `scale` (three factors above 0): one mesh or hull in many
// sizes.
//
// Round shapes stay round where the factors let them; otherwise they become a hull (of a sphere some hundred points). Parts of a
// compound that are turned can only be stretched alike along all axes. A border (DcdShapeInfo.border) keeps its thickness.
//
// `scale` is read during the call. The other shape may be destroyed afterwards.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT (a factor that is not above 0 or makes the shape too
// small or too large, or a compound that cannot be stretched so).
DCD_API DcdStatus dcd_shape_scale(DcdWorld world, DcdShapeId shape, const float *scale, DcdShapeId *out);

// Destroys a shape's handle. Bodies made with it keep their shape.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice).
DCD_API DcdStatus dcd_shape_destroy(DcdWorld world, DcdShapeId shape);

// Creates one body, as dcd_bodies_create does.
DCD_API DcdStatus dcd_body_create(DcdWorld world, const DcdBodyDef *def, DcdBodyId *out);

// Creates `count` bodies, all or none. `defs` and `out` have `count` entries; `defs` is read during the call. Bodies are in the
// world at once, and the next step moves them.
//
// - The bodies of a client or participant are avatars. DCD_CHANGE_APPEARED or DCD_CHANGE_REFUSED tells what became of each.
// - The bodies of a server or a builder are the world's own, of any kind. They stay when a builder leaves. Nodes compute them from
//   some ticks after the next dcd_step on. A builder is told what became of each, as a client is.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a member out of range, more than DCD_MAX_ITEMS bodies, a dynamic body without mass or faster than
//   DcdWorldInfo.speed_limit, or an avatar of a mesh or terrain.
// - DCD_ERR_LIMIT: the world has given 4,294,967,295 ids.
// - DCD_ERR_UNSUPPORTED: a node; an avatar that is fixed, of DCD_KINEMATIC_POSE, or with thresholds of sleep.
// - DCD_ERR_NETWORK: the link is gone.
DCD_API
DcdStatus dcd_bodies_create(DcdWorld world,
                            const DcdBodyDef *defs,
                            size_t count,
                            DcdBodyId *out);

// Destroys `count` bodies with their joints, all or none. Contacts that they had are reported as ended after the next step.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID (the world, a body, or a body named twice).
// - DCD_ERR_ARGUMENT: more than DCD_MAX_ITEMS.
// - DCD_ERR_UNSUPPORTED: a body of others in a served world.
DCD_API DcdStatus dcd_bodies_destroy(DcdWorld world, const DcdBodyId *bodies, size_t count);

// Destroys one body, as dcd_bodies_destroy does.
DCD_API DcdStatus dcd_body_destroy(DcdWorld world, DcdBodyId body);

// Returns whether the id names a body of this world. Returns false also from within a function that the library calls, and once
// the world answers DCD_ERR_PANIC.
DCD_API bool dcd_body_is_valid(DcdWorld world, DcdBodyId body);

// Finds the body that the world numbered `index` when it was made: body i of a scene, or the i-th body that was created.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (the body is destroyed, or there is none yet).
DCD_API DcdStatus dcd_body_at(DcdWorld world, uint32_t index, DcdBodyId *out);

// Creates a character: a body, of DCD_KINEMATIC, that walks by itself. It walks on what it stands on, slides along walls, climbs
// steps and slopes, falls, rides on what moves, and pushes what is in its way.
//
// dcd_body_set_velocity says where the character wants to go: along the ground, and upwards to jump, which it can from the ground.
// With a gravity_scale of 0 it flies as it wants, and collides all the same. dcd_body_get tells how it moves. Its shape must have
// volume. dcd_collider_add gives it further shapes, which only meet what comes.
//
// In a served world the node that computes the character walks it, also a client's: it stops at a wall without a delay, and its
// client cannot put it elsewhere (dcd_body_set_pose). A client may have 32 characters and vehicles together. Its characters take
// steps (step_height, step_depth, snap) of at most 1 m, keep a gap of at most 0.1 m, and weigh at most 10,000 kg.
// Errors: as dcd_bodies_create, and DCD_ERR_ARGUMENT (another body_type, a sensor, a shape without volume such as terrain or a
// segment, or a setting out of range).
DCD_API
DcdStatus dcd_character_create(DcdWorld world,
                               const DcdBodyDef *body,
                               const DcdCharacterDef *character,
                               DcdBodyId *out);

// Creates a vehicle: a body, of DCD_DYNAMIC, that is a chassis on wheels. Each wheel is a ray along its suspension to the nearest
// collider that the chassis may collide with. dcd_vehicle_drive says what its driver does. What the vehicle stands on feels
// nothing of it.
//
// In a served world the node that computes the vehicle drives it, also a client's, without a delay between wheels and ground. A
// client's vehicle is bounded:
// - It has at most 8 wheels, within 10 m.
// - Its top_speed is at most the world's avatar_speed.
// - Its suspensions together speed it up by at most 200 m/s² (stiffness x travel), and are damped by at most 60 1/s.
//
// A vehicle above 1e9 kg, or at more than 1e5 m/s, has no wheels.
// Errors: as dcd_bodies_create, and DCD_ERR_ARGUMENT (another body_type or a setting out of range).
DCD_API
DcdStatus dcd_vehicle_create(DcdWorld world,
                             const DcdBodyDef *body,
                             const DcdVehicleDef *vehicle,
                             DcdBodyId *out);

// Sets what the driver of a vehicle does from now on, and wakes the vehicle. A client or participant drives its own avatars; a
// local world or a server drives any vehicle, and a builder those of the world's own. In a served world the next dcd_step asks for
// it.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: numbers out of range, or a body that is no vehicle.
// - DCD_ERR_UNSUPPORTED: a body that this process may not drive.
DCD_API
DcdStatus dcd_vehicle_drive(DcdWorld world,
                            DcdBodyId vehicle,
                            const DcdDrive *drive);

// Reads how a character of a local world stands after the last step: whether it is on the ground, on what, how steep that is, and
// whether it slides down it. A character that has just been created is in the air until the next step.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a body that is no character (dcd_character_create).
// - DCD_ERR_UNSUPPORTED: in a served world, which tells where characters are and no more. Submit a ray or a cast downwards there.
DCD_API DcdStatus dcd_character_state(DcdWorld world, DcdBodyId character, DcdCharacterState *out);

// Reads the state of each wheel of a vehicle of a local world after the last step, in the order of DcdVehicleDef.wheels: where to
// draw it, and on what it stands. Each call casts a ray for every wheel.
//
// Writes the wheels to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the
// number.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
// - DCD_ERR_ARGUMENT: a body that is no vehicle (dcd_vehicle_create).
// - DCD_ERR_UNSUPPORTED: in a served world, which tells where vehicles are and no more. Submit a ray for each wheel there.
DCD_API
DcdStatus dcd_vehicle_wheels(DcdWorld world,
                             DcdBodyId vehicle,
                             DcdWheelState *out,
                             size_t cap,
                             size_t *count);

// Reads the type, mass, owner, forces and sleep of a body.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_body_info(DcdWorld world, DcdBodyId body, DcdBodyInfo *out);

// Reads the pose and velocity of a body. `pose` or `velocity` may be null. For many bodies use dcd_state_view and dcd_state_read.
// A client or participant reads what it was last told, every DcdServerDef.state_every steps; to draw, use dcd_view_body.
//
// Errors: DCD_ERR_NULL (world, body), DCD_ERR_STALE_ID.
DCD_API DcdStatus dcd_body_get(DcdWorld world, DcdBodyId body, DcdPose *pose, DcdVelocity *velocity);

// Interpolates between two poses, for drawing between steps: `t` = 0 is `from`, 1 is `to`. Positions go straight, rotations by
// SLERP the shorter way. `from`, `to` and `out` may be the same. The call needs no world, and may run beside any other call.
//
// Errors: DCD_ERR_NULL, DCD_ERR_ARGUMENT (a `t` that is not finite, a pose out of range, or a q that is not of length 1).
DCD_API DcdStatus dcd_pose_interpolate(const DcdPose *from, const DcdPose *to, double t, DcdPose *out);

// Teleports a body to a pose, whatever is there, and wakes it.
//
// - In a local world any body may be moved, also a fixed one. The body keeps its velocity.
// - A client or participant moves its own avatars except characters, which obey dcd_body_set_velocity alone. A server moves all
//   but fixed bodies; a builder does so with the world's own. The next dcd_step asks for it. The body gets the velocity that this
//   process last heard of (dcd_body_get), up to half a second old, or the one that is set in the same step.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: a pose out of range, or whose q is not of length 1.
// - DCD_ERR_UNSUPPORTED: a body that this process may not move.
DCD_API DcdStatus dcd_body_set_pose(DcdWorld world, DcdBodyId body, const DcdPose *pose);

// Sets the velocity of a dynamic or kinematic body, and wakes it. A client or participant drives its own avatars, a server all
// bodies, and a builder those of the world's own. In a served world the next dcd_step asks for it.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: numbers out of range, a dynamic body above DcdWorldInfo.speed_limit, a fixed body, or one that follows
//   poses.
// - DCD_ERR_UNSUPPORTED: a body that this process may not drive.
DCD_API DcdStatus dcd_body_set_velocity(DcdWorld world, DcdBodyId body, const DcdVelocity *velocity);

// Sets the kinematic target of a body of type DCD_KINEMATIC_POSE: the pose that it has after the next step. What it touches feels
// the speed that this takes. The body stays there until it gets another target. For many bodies use dcd_state_write.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: another type; a pose out of range, whose q is not of length 1, or so far off that the body would be faster
//   than DCD_MAX_NUMBER.
// - DCD_ERR_UNSUPPORTED: in a served world.
DCD_API DcdStatus dcd_body_set_target(DcdWorld world, DcdBodyId body, const DcdPose *pose);

// Wakes a body. Bodies wake by themselves when something that moves touches them.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (in a served world, except for its server and builders, which wake
// movable bodies).
DCD_API DcdStatus dcd_body_wake(DcdWorld world, DcdBodyId body);

// Puts a body to sleep: it stops, and costs nothing until something wakes it. A body that touches others that are
// awake, or is tied to them, is woken in the next step: put all of them to sleep.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (in a served world).
DCD_API DcdStatus dcd_body_sleep(DcdWorld world, DcdBodyId body);

// Applies an impulse to a dynamic body, and wakes it. `impulse` is in N s, world axes, and acts at `point` in world space, metres;
// a null `point` is the centre of mass.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: a body that is not dynamic, or that would be faster than DCD_MAX_NUMBER. Forces and impulses themselves may
//   be larger. Servers and builders do not know masses: there the nodes leave out what would make the body so fast.
// - DCD_ERR_UNSUPPORTED: clients that may not build, participants and nodes.
DCD_API
DcdStatus dcd_body_apply_impulse(DcdWorld world,
                                 DcdBodyId body,
                                 const float *impulse,
                                 const double *point);

// Applies an angular impulse to a dynamic body, and wakes it. `impulse` is in N m s, world axes. Errors: as
// dcd_body_apply_impulse.
DCD_API DcdStatus dcd_body_apply_torque_impulse(DcdWorld world, DcdBodyId body, const float *impulse);

// Sets the force and torque on a dynamic body in every step from now on, and wakes it. `force` is in N and acts at the centre of
// mass; `torque` is in N m. Both are in world axes, and null is none. Set both to none to stop. A later call replaces what an
// earlier one set.
//
// Errors: as dcd_body_apply_impulse.
DCD_API DcdStatus dcd_body_set_force(DcdWorld world, DcdBodyId body, const float *force, const float *torque);

// Adds a force to that of dcd_body_set_force. `force` is in N, world axes, and acts at `point` in world space, metres; a null
// `point` is the centre of mass. Its torque is computed now, and stays when the body moves on. For a thruster, set no force and
// add those of all thrusters before each step.
//
// Errors: as dcd_body_apply_impulse, and DCD_ERR_UNSUPPORTED also for servers and builders, which set the whole force
// (dcd_body_set_force).
DCD_API DcdStatus dcd_body_add_force(DcdWorld world, DcdBodyId body, const float *force, const double *point);

// Pushes all dynamic bodies near a place away from it, once and at once, and wakes them. Writes their number to `pushed`, which
// may be null.
//
// Each of their colliders near the place that is no sensor is pushed at its nearest point, away from the centre, by its
// silhouette: of two bodies of one size the lighter flies off faster. Walls give no shelter: cast rays to know of them. No body
// becomes faster by it than the world's speed limit.
//
// `explosion` is read during the call.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a member out of range. Then nothing is pushed.
// - DCD_ERR_UNSUPPORTED: in a served world. Its server finds bodies by dcd_overlap_shapes_submit and pushes them.
DCD_API DcdStatus dcd_explode(DcdWorld world, const DcdExplosion *explosion, size_t *pushed);

// Pushes the dynamic bodies that are in a fluid as the fluid does in one step, and wakes them. Call it before each dcd_step, for
// each lake and each wind. Writes the number of bodies to `pushed`, which may be null.
//
// The fluid acts on each collider that is no sensor and whose box (AABB) touches the box of the fluid, by the part of it below the
// surface:
// - Buoyancy. The weight of the fluid that it displaces lifts it, at the centre of that volume.
// - Drag. 1/2 density drag A v² acts at the centre of mass, by the silhouette A against the motion v through the fluid.
// - Dynamic lift. Each face that is turned to the motion, with a shadow A, is pressed by 1/2 density lift A v² against its normal;
//   of this, what is across the flow counts. It lifts sails and leaves.
// - Damping. Motion and spin die down by `damping` times the mass displaced over the body's own.
//
// Neither drag nor damping ever turns a motion about. Buoyancy comes at once and weight over the step. So between two steps what
// floats at rest has a velocity of up to half of gravity times dt downwards, and does not move. Terrain and open meshes displace
// nothing and are left alone. The border of rounded shapes does not count, as it does not for their mass. No fluid makes a body
// faster than the world's speed limit.
//
// `fluid` is read during the call.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a member out of range, or a min above its max. Then nothing is pushed.
// - DCD_ERR_UNSUPPORTED: in a served world. Its server finds bodies by dcd_overlap_boxes_submit and pushes them.
DCD_API
DcdStatus dcd_flow(DcdWorld world,
                   const DcdFluid *fluid,
                   size_t *pushed);

// Lists the movable bodies that overlap a sensor, oldest first, as the world is now: asleep or not, whichever region they are in,
// also when they were made or moved since the last step.
//
// `collider` says which collider of `body` is the sensor, from 0. Groups and masks of both colliders count. Other sensors and
// fixed bodies are not listed, and no events need be asked for. dcd_events reports which bodies come and go.
//
// Writes the ids to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the
// number.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: a collider that is not there or is no sensor.
// - DCD_ERR_SMALL_BUFFER: `count` is written all the same, `out` is not.
// - DCD_ERR_UNSUPPORTED: in a served world.
DCD_API
DcdStatus dcd_sensor_bodies(DcdWorld world,
                            DcdBodyId body,
                            uint32_t collider,
                            DcdBodyId *out,
                            size_t cap,
                            size_t *count);

// Reads the properties of a body.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_body_properties(DcdWorld world, DcdBodyId body, DcdBodyProperties *out);

// Changes the properties of a body: read them by dcd_body_properties, change members, and give them back. What is as it was stays
// as it is. If anything but user_data was changed, the body wakes. A body that becomes fixed, or movable, loses the memory of its
// contacts.
//
// `properties` is read during the call.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a member out of range, a link of a multibody that would be fixed, or a dynamic body that would have no mass.
// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies and let them be
//   movable.
DCD_API
DcdStatus dcd_body_set_properties(DcdWorld world,
                                  DcdBodyId body,
                                  const DcdBodyProperties *properties);

// Reads the properties of one collider of a body. `collider` is its number, from 0.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT (a collider that is not there).
DCD_API
DcdStatus dcd_collider_properties(DcdWorld world,
                                  DcdBodyId body,
                                  uint32_t collider,
                                  DcdColliderProperties *out);

// Changes the properties of one collider of a body: read them by dcd_collider_properties, change members, and give them back. What
// is as it was stays as it is. Contacts that there are feel a change in the next step; what touches the body wakes.
//
// `properties` is read during the call.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a collider that is not there, or a member out of range.
// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies.
DCD_API
DcdStatus dcd_collider_set_properties(DcdWorld world,
                                      DcdBodyId body,
                                      uint32_t collider,
                                      const DcdColliderProperties *properties);

// Adds a collider to a body, as the last of its colliders. Its number goes to `out`, which may be null. The contacts of the body
// begin anew, without memory.
//
// `properties` is read during the call; null is DCD_COLLIDER_PROPERTIES_INIT.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world, body or shape), DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a member out of range, or more than DCD_MAX_COLLIDERS.
// - DCD_ERR_UNSUPPORTED: in a served world.
DCD_API
DcdStatus dcd_collider_add(DcdWorld world,
                           DcdBodyId body,
                           DcdShapeId shape,
                           const DcdColliderProperties *properties,
                           uint32_t *out);

// Removes a collider from a body. The numbers of the colliders after it move down by one. The contacts of the body begin anew,
// without memory.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a collider that is not there or is the only one), DCD_ERR_UNSUPPORTED
// (in a served world).
DCD_API DcdStatus dcd_collider_remove(DcdWorld world, DcdBodyId body, uint32_t collider);

// Sets the shape of a collider of a body. The contacts of the body begin anew, without memory.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world, body or shape), DCD_ERR_ARGUMENT (a collider that is not there),
// DCD_ERR_UNSUPPORTED (in a served world).
DCD_API
DcdStatus dcd_collider_set_shape(DcdWorld world,
                                 DcdBodyId body,
                                 uint32_t collider,
                                 DcdShapeId shape);

// Sets what dcd_events reports of a body, as DcdBodyDef.events and force_threshold do when it is made: DCD_EVENT_… bits and
// newtons. `collider` is the number of one of its colliders, from 0, or DCD_ALL_COLLIDERS.
//
// The end of a contact that is there already is reported only if its beginning was. Where neither of its two colliders is to
// report it any more, the end is reported with the next step.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: a collider that is not there, unknown bits, or a threshold below 0.
// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies.
DCD_API
DcdStatus dcd_body_set_events(DcdWorld world,
                              DcdBodyId body,
                              uint32_t collider,
                              uint32_t events,
                              float force_threshold);

// Sets how a body slides and bounces: friction, a Coulomb coefficient of 0 or more, and restitution, 0 to 1. `collider` is as in
// dcd_body_set_events. Contacts that there are feel a change in the next step; what touches the body wakes.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: a collider that is not there, or a coefficient out of range.
// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies.
DCD_API
DcdStatus dcd_body_set_material(DcdWorld world,
                                DcdBodyId body,
                                uint32_t collider,
                                float friction,
                                float restitution);

// Sets which groups a body belongs to and which it meets, as DcdBodyDef.groups and mask do. `collider` is as in
// dcd_body_set_events.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: a collider that is not there.
// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies.
DCD_API
DcdStatus dcd_body_set_groups(DcdWorld world,
                              DcdBodyId body,
                              uint32_t collider,
                              uint32_t groups,
                              uint32_t mask);

// Reads the kind and measures of a shape that the program made or found.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_shape_info(DcdWorld world, DcdShapeId shape, DcdShapeInfo *out);

// Reads the vertices of a hull, mesh, terrain, lines or voxels into `xyz`, which has 3 x `cap` floats, and their number into
// `count`. With `cap` 0, `xyz` may be null, to ask for the number.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_SMALL_BUFFER (`count` is written all the same, `xyz` is not).
DCD_API DcdStatus dcd_shape_vertices(DcdWorld world, DcdShapeId shape, float *xyz, size_t cap, size_t *count);

// Reads the triangles of a hull, mesh, terrain, lines or voxels into `indices`, which has room for 3 x `cap` indices of vertices,
// and their number into `count`. Triangles are counterclockwise seen from outside. With `cap` 0, `indices` may be null, to ask for
// the number.
//
// Errors: as dcd_shape_vertices.
DCD_API
DcdStatus dcd_shape_triangles(DcdWorld world,
                              DcdShapeId shape,
                              uint32_t *indices,
                              size_t cap,
                              size_t *count);

// Reads the heights of terrain into `heights`, which has `cap` entries, as dcd_shape_heightfield takes them, and their number into
// `count`: 0 for other shapes. With `cap` 0, `heights` may be null, to ask for the number.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_SMALL_BUFFER (`count` is written all the same, `heights` is
// not).
DCD_API
DcdStatus dcd_shape_heights(DcdWorld world,
                            DcdShapeId shape,
                            float *heights,
                            size_t cap,
                            size_t *count);

// Lists all bodies, fixed ones too, in the order in which they were made. In a served world these are the bodies that this process
// has heard of: first those of the scene and the server's program, then avatars, client by client, then what builders have built.
//
// Writes the ids to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the
// number.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not),
// DCD_ERR_UNSUPPORTED (a node).
DCD_API
DcdStatus dcd_bodies(DcdWorld world,
                     DcdBodyId *out,
                     size_t cap,
                     size_t *count);

// Reads how large and heavy a body is as it is now. This follows from its shapes and properties, so in a served world it is known
// of every body that this process has heard of. The call takes some microseconds, and more for a body of many vertices.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
DCD_API DcdStatus dcd_body_extent(DcdWorld world, DcdBodyId body, DcdBodyExtent *out);

// Finds the shape of one collider of any body that this process knows. `collider` is its number, from 0. dcd_collider_properties
// says where it sits on the body.
//
// Equal shapes have one handle, so a renderer can keep what it makes of a shape by its handle. The handle from the shape function
// that made the shape is another one. The handle need not be destroyed, and does not keep the shape: some time after no body and
// no compound has the shape any more, the handle is stale. Once it is stale or destroyed, the call gives a new one.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a collider that is not there), DCD_ERR_UNSUPPORTED (a node).
DCD_API DcdStatus dcd_collider_shape(DcdWorld world, DcdBodyId body, uint32_t collider, DcdShapeId *out);

// Finds one of the shapes that a compound is made of, by its number `part`, from 0, as dcd_collider_shape does. `frame` receives
// where it is in the compound, and may be null.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT (a part that is not there).
DCD_API
DcdStatus dcd_shape_part(DcdWorld world,
                         DcdShapeId shape,
                         uint32_t part,
                         DcdShapeId *out,
                         DcdFrame *frame);

// Creates a joint between two bodies and wakes both. The joint is gone when either body is destroyed.
//
// In a local world the two may be any bodies of which one is not fixed. A joint whose bodies are both made fixed later
// (dcd_body_set_properties) is gone; make one of them kinematic where it must last.
//
// A server, or a builder, ties bodies of its own: those that it made since its last dcd_step, or one of them and a fixed one. Servers
// and builders may drive and destroy any joint. Clients that may not build, and nodes, have no joints (DCD_ERR_UNSUPPORTED).
//
// One region owns what joints tie together, and it moves whole, so keep it small against a region.
//
// `def` is read during the call.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world or a body), DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a member out of range, a limit or motor of a joint without an axis of its own, twice the same body, or two
//   fixed bodies.
DCD_API
DcdStatus dcd_joint_create(DcdWorld world,
                           const DcdJointDef *def,
                           DcdJointId *out);

// Destroys a joint and wakes its bodies.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice, or when one of its bodies was destroyed).
DCD_API DcdStatus dcd_joint_destroy(DcdWorld world, DcdJointId joint);

// Returns whether the id names a joint of this world. Returns false also from within a function that the library calls, and once
// the world answers DCD_ERR_PANIC.
DCD_API bool dcd_joint_is_valid(DcdWorld world, DcdJointId joint);

// Reads the state of a joint: what it ties, where it stands, what it bears.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_joint_info(DcdWorld world, DcdJointId joint, DcdJointInfo *out);

// Sets the limit of one axis of a joint, and wakes its bodies. `limit` points to the lowest and the highest position, metres or
// radians; -INFINITY and INFINITY leave a side open. A null `limit` takes the limit away. Coupled axes have one limit, and that of
// a rope is DCD_AXIS_X. Where the position is a distance, its lowest is 0.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (numbers out of range, a lowest above the highest, or an axis that is
// locked or none).
DCD_API
DcdStatus dcd_joint_set_limit(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              const float *limit);

// Sets the motor of one axis of a joint, and wakes its bodies. A null `motor` stops the motor: the axis is free again. Coupled
// axes have one motor, and that of a spring is DCD_AXIS_X.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (numbers out of range, an unknown model, an axis that is locked or
// none, or coupled axes about which it would turn).
DCD_API
DcdStatus dcd_joint_set_motor(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              const DcdJointMotor *motor);

// Reads the limit of one axis of a joint, lowest and highest, into `out`, which has two entries: -INFINITY to INFINITY where there
// is none.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (an axis that is locked or none).
DCD_API
DcdStatus dcd_joint_get_limit(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              float *out);

// Reads the motor of one axis of a joint; all is 0 where none runs.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (an axis that is locked or none).
DCD_API
DcdStatus dcd_joint_get_motor(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              DcdJointMotor *out);

// Sets where a joint sits on `a` and on `b`, and wakes its bodies. A null frame stays as it is.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a frame that is not finite or no rotation).
DCD_API
DcdStatus dcd_joint_set_frames(DcdWorld world,
                               DcdJointId joint,
                               const DcdFrame *frame_a,
                               const DcdFrame *frame_b);

// Sets whether a joint acts and whether its bodies collide with one another, and wakes them. `flags` has DCD_JOINT_COLLIDE and
// DCD_JOINT_DISABLED bits.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (other bits).
DCD_API DcdStatus dcd_joint_set_flags(DcdWorld world, DcdJointId joint, uint32_t flags);

// Sets how stiffly a joint holds what it locks and limits, as in DcdJointDef, and wakes its bodies.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (numbers out of range).
DCD_API
DcdStatus dcd_joint_set_softness(DcdWorld world,
                                 DcdJointId joint,
                                 float natural_frequency,
                                 float damping_ratio);

// Lists the joints of a body, oldest first. Writes the ids to `out`, which has `cap` entries, and their number to `count`. With
// `cap` 0, `out` may be null, to ask for the number.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
DCD_API
DcdStatus dcd_body_joints(DcdWorld world,
                          DcdBodyId body,
                          DcdJointId *out,
                          size_t cap,
                          size_t *count);

// Sets how much the locked axes of a joint bear: `force` in newtons and `torque` in newton metres, 0 or more; INFINITY for any
// load, as at first. After each dcd_step in which the joint bears more, DcdEventView.overloads reports it. The joint stays as it
// is until the program destroys it. The strength is saved with the world.
//
// The load is that of the whole joint, however many regions share it. It is that of the solver's last iteration, without the
// forces of limits and motors. A load that lasts shows. Of a blow, only what the last iteration had left to bear shows. The torque
// is not that about the anchor, unless this is the body's centre of mass: go by the force.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or joint), DCD_ERR_ARGUMENT (numbers below 0 or NaN), DCD_ERR_UNSUPPORTED (in a
// served world).
DCD_API
DcdStatus dcd_joint_set_strength(DcdWorld world,
                                 DcdJointId joint,
                                 float force,
                                 float torque);

// Advances the world by one step of its own length, DcdWorldInfo.dt. Call it as often as the program's clock says. The length is
// the world's and not an argument, since every process that computes the world must use the same.
//
// A served world advances by itself. There the call sends what was asked of avatars, takes in what has come since the last call,
// and returns without waiting for anything.
//
// The arrays that dcd_state_view lent two steps ago are overwritten. Other calls on the world wait until the step is done; views
// lent before may be read meanwhile.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_BUSY, DCD_ERR_PANIC.
// - DCD_ERR_NETWORK: the link to the server is gone, or the world has ended. The last state stays readable, and what came before
//   the loss is in dcd_events.
// - DCD_ERR_IO: a server could not write its folder, and has stopped; or its world has ended and its recording is not whole.
//
// After DCD_ERR_NETWORK or DCD_ERR_IO each later step says so again, and what is known can still be read.
DCD_API DcdStatus dcd_step(DcdWorld world);

// Begins what dcd_step does, on a thread of the library, and returns at once. dcd_step_wait says what became of it. Meanwhile the
// program may draw what dcd_state_view lent, which stays as it is until the step after this one. Every other call on the world
// waits until the step is done, and then sees its result.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_BUSY (a step was begun and dcd_step_wait has not told of it yet), DCD_ERR_LIMIT
// (no thread), DCD_ERR_PANIC.
DCD_API DcdStatus dcd_step_begin(DcdWorld world);

// Waits until the step that dcd_step_begin began is done, but not longer than `timeout_ns` nanoseconds: 0 only looks, DCD_FOREVER
// has no limit. Returns what dcd_step would have, once for each step that was begun.
//
// Errors: those of dcd_step, DCD_ERR_TIMEOUT (the step is not done), DCD_ERR_ARGUMENT (no step was begun).
DCD_API DcdStatus dcd_step_wait(DcdWorld world, uint64_t timeout_ns);

// Sets the job system whose threads compute a local world from the next dcd_step on, instead of threads of the library's, which
// end. A null `tasks` goes back to the library's threads. `tasks` is read during the call. Its functions and `context` must be
// there until others are set or the world is destroyed.
//
// - Sharing. A step that is worth it (some hundred awake bodies) starts DcdWorldDef.threads tasks and waits a tenth of a
//   millisecond for them to begin. Tasks that have begun share the work. If none has, the calling thread does it alone, so that no
//   step waits for a thread that is busy elsewhere. The same holds for a call with many queries.
// - Waiting. The calling thread waits meanwhile: it is best none of the job system's own. Every task is finished before dcd_step
//   returns, those that came too late too.
// - Results. They do not depend on any of it.
// - Callers. The functions are called by the thread that calls dcd_step, by one of the library's after dcd_step_begin, and by each
//   thread that asks many queries: by several threads at a time where several ask.
// - Duties. The functions must return normally (no longjmp, no C++ exception). Calls on worlds from within them give DCD_ERR_BUSY,
//   so a thread that helps others while it waits must not take on a job that calls the library.
//
// The functions are not saved with the world.
// Errors:
// - DCD_ERR_NULL (world, a function), DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT.
// - DCD_ERR_LIMIT: the system gives no threads to go back to.
// - DCD_ERR_UNSUPPORTED: in a served world.
DCD_API
DcdStatus dcd_tasks_set(DcdWorld world,
                        const DcdTasks *tasks);

// Reads how a world is stepped. A node takes its settings from its server and cannot tell them.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
DCD_API DcdStatus dcd_settings(DcdWorld world, DcdSettings *out);

// Changes how a world is stepped, from the next dcd_step on: read the settings by dcd_settings, change members, and give them
// back. Bodies that sleep are woken if gravity changes. The settings are saved with the world.
//
// A served world keeps the settings with which its server was made, and is stepped by Rapier's own parameters. In a world that is
// to be a server's source, change only gravity, dt, solver_iterations, tolerance and speed_limit.
//
// `settings` is read during the call.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: a member out of range. Then nothing is changed.
// - DCD_ERR_UNSUPPORTED: in a served world.
DCD_API DcdStatus dcd_settings_set(DcdWorld world, const DcdSettings *settings);

// Changes gravity, m/s², as dcd_settings_set does. `gravity` has three floats.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (numbers out of range), DCD_ERR_UNSUPPORTED (in a served world).
DCD_API DcdStatus dcd_gravity_set(DcdWorld world, const float *gravity);

// Lends the state of every movable body as arrays, without copying, as it was after the last step. What was made or changed since
// shows after the next one. Before the first step, and in the first call of all, the view shows the present. A client or
// participant is told states every DcdServerDef.state_every steps; to draw the steps between, use dcd_view_state.
//
// The arrays are the library's: do not write or free them. They keep their content until the step after next begins. Then they are
// overwritten, and the memory stays readable until the world is destroyed. So another thread may read them while this one makes
// one step. To go back (dcd_checkpoint_restore, dcd_snapshot_load) counts as a step. Before the first step every call overwrites
// the arrays. The first call makes every later dcd_step fill the arrays, some 30 ns per body.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
DCD_API
DcdStatus dcd_state_view(DcdWorld world,
                         DcdStateView *out);

// Copies one field of `count` bodies, as it is now, into the program's memory. The field of bodies[i] goes to (char *)dst + i *
// stride. `stride`, in bytes, is at least the field's size; 0 is exactly that. `dst` needs no alignment.
//
// With `each` null, the first bad body fails the call and nothing is written. Otherwise `each` has `count` entries that receive
// DCD_OK or what is wrong with that body. Then only good bodies are written, and the call returns DCD_OK; dcd_last_error() tells
// of the last bad one.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (an unknown field, a short stride, or more than DCD_MAX_ITEMS).
DCD_API
DcdStatus dcd_state_read(DcdWorld world,
                         const DcdBodyId *bodies,
                         size_t count,
                         DcdField field,
                         void *dst,
                         size_t stride,
                         DcdStatus *each);

// Sets one field of `count` bodies from the program's memory, laid out as for dcd_state_read. It does what dcd_body_set_pose,
// dcd_body_set_velocity, dcd_body_set_force and dcd_body_set_target do.
//
// With `each` null, the first bad body or value fails the call. The bodies before it are changed already, unless an id was bad:
// ids are checked first. Otherwise `each` has `count` entries that receive DCD_OK or what is wrong with that body, and the call
// returns DCD_OK.
// Errors: as dcd_state_read, and those of the single calls.
DCD_API
DcdStatus dcd_state_write(DcdWorld world,
                          const DcdBodyId *bodies,
                          size_t count,
                          DcdField field,
                          const void *src,
                          size_t stride,
                          DcdStatus *each);

// Returns the ticks to show now. Call it once per frame, from any thread.
//
// - Served world. States come some times per second, late, unevenly, and not all of them. `shown` is as little behind the world as
//   that allows, and goes forward evenly. From the first call on, a client pings the node that tells it of the world, and keeps
//   the states that it was told last.
// - Local world. `shown` goes from one step to the next as time goes by since the last dcd_step. From the first call on, steps
//   keep how awake bodies were before, some 50 ns each.
// - Server. It shows its world as it was heard of last.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
DCD_API
DcdStatus dcd_view_time(DcdWorld world,
                        DcdViewTime *out);

// Reads how a body is shown at a tick: its pose and velocity. `pose` or `velocity` may be null.
//
// Between known states, positions follow cubic Hermite splines, or two straight lines where the velocities tell of an impact;
// rotations follow SLERP. Beyond the last state the body goes on, and comes to a stop within a quarter of a second. Where a later
// state contradicts what was shown at the last dcd_view_time, the difference melts away within 0.2 s, and 0.1 s more per metre;
// above 3 m the body jumps. Before the first dcd_view_time, and for a server, the result is that of dcd_body_get.
// Errors: DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a tick that is no finite number).
DCD_API
DcdStatus dcd_view_body(DcdWorld world,
                        DcdBodyId body,
                        double tick,
                        DcdPose *pose,
                        DcdVelocity *velocity);

// Lends every movable body as it is shown, as dcd_state_view lends them as they are. Own avatars, with what they touch, are shown
// at time->predicted, all others at time->shown. What comes near goes from the one to the other within a second. Set both to the
// same where an own avatar is to be shown with the others. `tick` of the view is that of the newest state.
//
// The arrays are the library's: do not write or free them. They keep their content until the next dcd_view_state of this world.
// The memory stays readable until the world is destroyed.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT (ticks that are no finite numbers), DCD_ERR_UNSUPPORTED
// (a node).
DCD_API
DcdStatus dcd_view_state(DcdWorld world,
                         const DcdViewTime *time,
                         DcdStateView *out);

// Draws a world by calling the functions of `draw`. Give `time` to draw a frame at the time that it shows (dcd_view_time). With
// `time` null, the world is drawn as it is after the last dcd_step. Boxes around bodies, centres of mass, ghosts and contacts are
// always of the last step.
//
// A local world draws everything. A client or participant draws what it is told: shapes, borders, velocities, avatars, labels. A
// server, whose record is half a second old, draws joints too. The rest is known only to processes that compute it, and is left
// out.
//
// The calling thread calls the functions, before this call returns. They must return normally (no longjmp, no C++ exception). The
// world is theirs meanwhile: calls of other threads on it wait, and every call on a world from within gives DCD_ERR_BUSY.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
// - DCD_ERR_ARGUMENT: unknown flags, a `min` that is above its `max`, NaN in them, or scales that are not finite. Corners may be
//   infinite.
// - DCD_ERR_BUSY: called from within a callback.
// - DCD_ERR_UNSUPPORTED: a node.
DCD_API DcdStatus dcd_debug_draw(DcdWorld world, const DcdViewTime *time, const DcdDebugDraw *draw);

// Writes the world as it is after the last step to a binary glTF file (.glb), for Blender and engines. Bodies are nodes named by
// their numbers ("b7", "c2/b0"), with their shapes in the colour of the region that owns them. A file that is there is replaced once
// the new one is whole. A symbolic link stays, and the file that it leads to is replaced. Devices, pipes and folders are refused.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_LIMIT (a file above 4 GiB), DCD_ERR_UNSUPPORTED (a node).
DCD_API
DcdStatus dcd_gltf_save_file(DcdWorld world,
                             const char *path);

// Sets whether a client or participant shows its own avatars, and what they touch, ahead of the world, so that they answer at
// once. At first it does.
//
// Once dcd_view_time was called, a client keeps a small world of what is within some metres of its avatars. What is asked of the
// avatars acts there in the same frame, and names the step for which it is meant (DcdViewTime.predicted), so that nodes do it in
// just that step. Where states that come are not as predicted, what follows is computed again, and the difference melts away as
// dcd_view_body says.
//
// At most 64 bodies are predicted, with what joints tie to them, for at most a second and a half. Assemblies with multibodies are
// not predicted, nor is anything in a world whose steps are not paced. A local world has nothing to predict.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (a server or a node).
DCD_API DcdStatus dcd_prediction_set(DcdWorld world, bool predicts);

// Reads what a client predicts, and how often it was wrong; all is 0 where nothing is predicted.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_prediction(DcdWorld world, DcdPrediction *out);

// Lists the connections of a world, oldest first. Writes the ids to `out`, which has `cap` entries, and their number to `count`.
// With `cap` 0, `out` may be null, to ask for the number.
//
// A server has a connection with each node, client and participant. Others have one with their server, and those with nodes and
// clients that their share of the world, or their avatars, ask for. A local world has none.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
DCD_API DcdStatus dcd_connections(DcdWorld world, DcdConnectionId *out, size_t cap, size_t *count);

// Reads the state and figures of a connection.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also once the connection is gone), DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_connection_info(DcdWorld world, DcdConnectionId connection, DcdConnectionInfo *out);

// Disconnects a process from a server's world, and returns at once. The process is told `reason`, a text shorter than
// DCD_MAX_REASON, or null for none. A node's regions are handed over first. A client's avatars wait for its return, which takes a
// new token. DCD_CONNECTION_GONE tells when the process is gone. There its dcd_step returns DCD_ERR_NETWORK with the reason.
//
// To leave a world, call dcd_world_destroy.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a reason that is too long), DCD_ERR_UNSUPPORTED (the world is not a
// server).
DCD_API DcdStatus dcd_disconnect(DcdWorld world, DcdConnectionId connection, const char *reason);

// Waits until something has come that the next dcd_step would take in, but not longer than `timeout_ms` milliseconds: states and
// events of a client's world, messages, changes of connections, or the end of the world. In a local world it does not wait at all.
// Once the world has ended or the server is given up, it returns at once, and dcd_step says why. Other calls on the world do not
// wait for this one.
//
// Errors: DCD_ERR_TIMEOUT (nothing has come), DCD_ERR_NULL, DCD_ERR_STALE_ID.
DCD_API
DcdStatus dcd_poll(DcdWorld world,
                   uint32_t timeout_ms);

// Sends `size` bytes to the program at the other end of a connection. There they are among the messages of dcd_events after its
// next dcd_step. A server's program speaks with that of every node, client and participant. Those speak with the server's only:
// what one client has to say to another passes through the server's program.
//
// - Messages. With `flags` 0 a message arrives once and in order, as long as the link lasts. It has at most DCD_MAX_MESSAGE bytes.
// - Datagrams. With DCD_SEND_UNRELIABLE it is a datagram of at most DCD_MAX_DATAGRAM bytes, which may be lost or overtaken, and
//   never waits.
// - Broken links. Messages on their way when a link breaks (DCD_CONNECTION_LOST) are lost.
// - Slow readers. The world never waits for messages, and a program that makes no steps takes none. Then up to 128 KiB wait there
//   and as much here, counting 64 bytes more for each message. Beyond that the call gives DCD_ERR_BUSY.
// - Dropped datagrams. Where 64 KiB of datagrams wait, the newest are dropped, and counted (DcdConnectionInfo.dropped).
//
// The call copies the bytes and returns at once. `data` may be null when `size` is 0.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: too many bytes, or unknown flags.
// - DCD_ERR_BUSY: too much waits already.
// - DCD_ERR_NETWORK: the connection is lost.
// - DCD_ERR_UNSUPPORTED: in a local world, and when neither end is a server.
DCD_API
DcdStatus dcd_send(DcdWorld world,
                   DcdConnectionId connection,
                   const void *data,
                   size_t size,
                   uint32_t flags);

// Lends the events of the last step; nothing before the first. Call it once per step: a step without it loses its events, and the
// messages that came.
//
// The arrays are the library's, and live as those of dcd_state_view do.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_events(DcdWorld world, DcdEventView *out);

// Lists the points at which a body touches others as they are after the last step, by pairs of colliders and manifolds. Sensors
// have none; dcd_events and dcd_overlap_shapes report them.
//
// Writes the points to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for
// the number.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not),
// DCD_ERR_UNSUPPORTED (in a served world).
DCD_API
DcdStatus dcd_body_contacts(DcdWorld world,
                            DcdBodyId body,
                            DcdContactPoint *out,
                            size_t cap,
                            size_t *count);

// Sets the functions that a local world asks about contacts from the next dcd_step on; a null `hooks` removes them. `hooks` is
// read during the call. The functions and `context` must be there until others are set or the world is destroyed.
//
// - Callers. The functions are called from within dcd_step (or the step that dcd_step_begin began), by any thread of the library
//   and by several at the same time, in no order that is promised. What pointers lead to is valid during the call.
// - Duties. They must return normally (no longjmp, no C++ exception), guard what they share, and call no function on a world: each
//   gives DCD_ERR_BUSY.
// - Regions. Every region that holds both bodies asks about its own copies. So the answer must depend on the pair and on what the
//   program changed between steps, and on nothing else. Otherwise regions disagree, and the result depends on how the world is
//   cut.
// - Resting pairs. A pair may be asked about in every step, or only when it begins to be near, for as long as it rests.
// - Saving. The functions are not saved with the world. A recording goes on, and has what they answered: a replay does not call
//   them.
//
// Errors: DCD_ERR_NULL (world), DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT, DCD_ERR_UNSUPPORTED (in a served world).
DCD_API
DcdStatus dcd_hooks_set(DcdWorld world,
                        const DcdHooks *hooks);

// Finds the first body that each of `count` rays meets; hits[i] belongs to rays[i]. Sensors count as bodies, unless `filter`
// overlooks them. A null filter overlooks nothing.
//
// This and the other queries see bodies where they are now, also those made or moved since the last step. Several threads may ask
// one world at the same time. A hundred and more queries of one call are spread over DcdWorldDef.threads. Queries are answered
// only where the whole world is. In a served world they give DCD_ERR_UNSUPPORTED; ask there by dcd_cast_rays_submit,
// dcd_cast_shapes_submit, dcd_overlap_shapes_submit, dcd_overlap_points_submit and dcd_overlap_boxes_submit.
//
// `rays` and `filter` are read during the call; `hits` has `count` entries.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world, or a body to exclude), DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED.
// - DCD_ERR_ARGUMENT: numbers that are not finite, a direction of length 0, a distance that is not above 0, unknown bits, or more
//   than DCD_MAX_ITEMS.
DCD_API
DcdStatus dcd_cast_rays(DcdWorld world,
                        const DcdRay *rays,
                        size_t count,
                        const DcdFilter *filter,
                        DcdRayHit *hits);

// Finds every body that each of `count` rays meets, the nearest first. Each collider of a body counts once.
//
// The hits of all rays go to `hits`, which has `cap` entries, and their number to `total`. The hits of rays[i] end before
// hits[ends[i]] and begin where those of the ray before end. `ends` has `count` entries. With `cap` 0, `hits` may be null, to ask
// for the number.
// Errors: as dcd_cast_rays, and DCD_ERR_SMALL_BUFFER (`total` is written all the same, and nothing else).
DCD_API
DcdStatus dcd_cast_rays_all(DcdWorld world,
                            const DcdRay *rays,
                            size_t count,
                            const DcdFilter *filter,
                            DcdRayHit *hits,
                            size_t cap,
                            size_t *ends,
                            size_t *total);

// Finds the first body that each of `count` moving shapes meets; hits[i] belongs to casts[i].
//
// `casts` and `filter` are read during the call; `hits` has `count` entries.
// Errors: as dcd_cast_rays, DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
DCD_API
DcdStatus dcd_cast_shapes(DcdWorld world,
                          const DcdShapeCast *casts,
                          size_t count,
                          const DcdFilter *filter,
                          DcdShapeHit *hits);

// Finds the place of any body that is nearest to each of `count` points; hits[i] belongs to points[i].
//
// `points` and `filter` are read during the call; `hits` has `count` entries.
// Errors: as dcd_cast_rays.
DCD_API
DcdStatus dcd_project_points(DcdWorld world,
                             const DcdPointQuery *points,
                             size_t count,
                             const DcdFilter *filter,
                             DcdPointHit *hits);

// Finds every body that each of `count` shapes overlaps, oldest first. The outputs are as of dcd_cast_rays_all.
//
// Errors: as dcd_cast_rays_all, DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
DCD_API
DcdStatus dcd_overlap_shapes(DcdWorld world,
                             const DcdShapeQuery *shapes,
                             size_t count,
                             const DcdFilter *filter,
                             DcdOverlap *found,
                             size_t cap,
                             size_t *ends,
                             size_t *total);

// Finds every body that each of `count` points lies in, oldest first. The outputs are as of dcd_cast_rays_all.
//
// Errors: as dcd_cast_rays_all.
DCD_API
DcdStatus dcd_overlap_points(DcdWorld world,
                             const DcdPointQuery *points,
                             size_t count,
                             const DcdFilter *filter,
                             DcdOverlap *found,
                             size_t cap,
                             size_t *ends,
                             size_t *total);

// Finds every body whose AABB (its own box along the axes of the world) touches each of `count` boxes, oldest first. These are the
// bodies that may overlap the box, found at little cost. The outputs are as of dcd_cast_rays_all.
//
// Errors: as dcd_cast_rays_all, DCD_ERR_ARGUMENT also for a box whose min is above its max.
DCD_API
DcdStatus dcd_overlap_boxes(DcdWorld world,
                            const DcdBoxQuery *boxes,
                            size_t count,
                            const DcdFilter *filter,
                            DcdOverlap *found,
                            size_t cap,
                            size_t *ends,
                            size_t *total);

// Calls `function` with every body that one ray meets, until it has enough. Each collider of a body counts once. The order is not
// promised. Use it for a question that dcd_cast_rays does not ask, such as what is thickest on the way, or the first body that a
// rule of the program's lets count.
//
// `ray` and `filter` are read during the call. Errors: as dcd_cast_rays.
DCD_API
DcdStatus dcd_cast_ray_each(DcdWorld world,
                            const DcdRay *ray,
                            const DcdFilter *filter,
                            DcdRayFn function,
                            void *context);

// Calls `function` with every body that one shape meets which moves straight, until it has enough. Each collider of a body counts
// once. The order is not promised. Use it for a way on which a rule of the program's says what stops the shape.
//
// `cast` and `filter` are read during the call. Errors: as dcd_cast_shapes, DCD_ERR_ARGUMENT also for a cast that turns.
DCD_API
DcdStatus dcd_cast_shape_each(DcdWorld world,
                              const DcdShapeCast *cast,
                              const DcdFilter *filter,
                              DcdShapeCastFn function,
                              void *context);

// Calls `function` with every body that a shape overlaps, until it has enough. Each collider of a body counts once. The order is
// not promised. To know whether a place is free, one body is enough.
//
// `shape` and `filter` are read during the call. Errors: as dcd_overlap_shapes.
DCD_API
DcdStatus dcd_overlap_shape_each(DcdWorld world,
                                 const DcdShapeQuery *shape,
                                 const DcdFilter *filter,
                                 DcdOverlapFn function,
                                 void *context);

// Calls `function` with every body whose AABB touches a box, as dcd_overlap_boxes finds them, until it has enough.
//
// `box` and `filter` are read during the call. Errors: as dcd_overlap_boxes.
DCD_API
DcdStatus dcd_overlap_box_each(DcdWorld world,
                               const DcdBoxQuery *box,
                               const DcdFilter *filter,
                               DcdOverlapFn function,
                               void *context);

// Submits `count` rays, to find what each meets first; dcd_query_poll fetches the answer. It is as dcd_cast_rays, and works in a
// served world too.
//
// - Served world. A client, a participant or the server's program asks the nodes. Each node answers for the bodies that it owns,
//   as they are after one and the same step, and the nearest counts. That takes some steps, and longer while nodes join or leave.
// - Unknown bodies. The nodes may find what this process does not know: bodies that a client with an area of interest was not told
//   of (dcd_interest_set), and bodies that come or go meanwhile. Such a hit has an id that is not valid (dcd_body_is_valid), and 0
//   as user_data and material.
// - Local world. The answer is there at once.
// - Server. What its program did since its last dcd_step is there for the query, which is then sent with the next dcd_step.
//
// `rays` and `filter` are read during the call. `out` receives the id of the query, which is open until it is fetched or
// cancelled.
// Errors:
// - As dcd_cast_rays.
// - DCD_ERR_ARGUMENT also: more than DCD_MAX_SUBMITTED_COST, or more than 64 KiB on its way, shapes and filter included, as so
//   many rays take with as many bodies in the filter.
// - DCD_ERR_BUSY: DCD_MAX_OPEN_QUERIES or DCD_MAX_OPEN_COST are open.
// - DCD_ERR_NETWORK: the link is gone.
// - DCD_ERR_UNSUPPORTED: a node.
DCD_API
DcdStatus dcd_cast_rays_submit(DcdWorld world,
                               const DcdRay *rays,
                               size_t count,
                               const DcdFilter *filter,
                               DcdQueryId *out);

// Submits `count` shape casts, to find what each meets first; dcd_query_poll_casts fetches the answer. It is as dcd_cast_shapes,
// where and when dcd_cast_rays_submit answers. The shapes travel along, and may be destroyed after the call.
//
// Errors:
// - As dcd_cast_rays_submit, DCD_ERR_STALE_ID also for a shape.
// - DCD_ERR_ARGUMENT also: a mesh or terrain, a turn longer than DCD_MAX_SUBMITTED_TURN, a turn of a shape larger than
//   DCD_MAX_TURNING_SIZE, or a turn with DCD_QUERY_LEAVE.
DCD_API
DcdStatus dcd_cast_shapes_submit(DcdWorld world,
                                 const DcdShapeCast *casts,
                                 size_t count,
                                 const DcdFilter *filter,
                                 DcdQueryId *out);

// Submits `count` shapes, to find every body that each overlaps; dcd_query_poll_overlaps fetches the answer. It is as
// dcd_overlap_shapes, where and when dcd_cast_rays_submit answers. The shapes travel along, and may be destroyed after the call.
//
// Errors: as dcd_cast_rays_submit, DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
DCD_API
DcdStatus dcd_overlap_shapes_submit(DcdWorld world,
                                    const DcdShapeQuery *shapes,
                                    size_t count,
                                    const DcdFilter *filter,
                                    DcdQueryId *out);

// Submits `count` points, to find every body that each lies in; dcd_query_poll_overlaps fetches the answer. It is as
// dcd_overlap_points, where and when dcd_cast_rays_submit answers.
//
// Errors: as dcd_cast_rays_submit.
DCD_API
DcdStatus dcd_overlap_points_submit(DcdWorld world,
                                    const DcdPointQuery *points,
                                    size_t count,
                                    const DcdFilter *filter,
                                    DcdQueryId *out);

// Submits `count` boxes, to find every body whose AABB touches each; dcd_query_poll_overlaps fetches the answer. It is as
// dcd_overlap_boxes, where and when dcd_cast_rays_submit answers.
//
// Errors: as dcd_cast_rays_submit, DCD_ERR_ARGUMENT also for a box whose min is above its max.
DCD_API
DcdStatus dcd_overlap_boxes_submit(DcdWorld world,
                                   const DcdBoxQuery *boxes,
                                   size_t count,
                                   const DcdFilter *filter,
                                   DcdQueryId *out);

// Fetches the answer to submitted rays, without waiting: hits[i] belongs to rays[i], null where the ray met nothing, and `count`
// receives their number. `hits` has `cap` entries. With `cap` 0, `hits` may be null, to ask for the number, and the query stays
// open unless that is 0. Once the answer is fetched, the query is closed and its id is stale.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world or query).
// - DCD_ERR_ARGUMENT: a query that is not of rays.
// - DCD_ERR_BUSY: the answer is not there yet. Nothing is written, and the query stays open.
// - DCD_ERR_SMALL_BUFFER: `count` is written all the same, and the query stays open.
// - DCD_ERR_NETWORK: the link is gone.
DCD_API
DcdStatus dcd_query_poll(DcdWorld world,
                         DcdQueryId query,
                         DcdRayHit *hits,
                         size_t cap,
                         size_t *count);

// Fetches the answer to submitted casts: hits[i] belongs to casts[i]. All else is as in dcd_query_poll.
DCD_API
DcdStatus dcd_query_poll_casts(DcdWorld world,
                               DcdQueryId query,
                               DcdShapeHit *hits,
                               size_t cap,
                               size_t *count);

// Fetches the answer to submitted overlaps. The outputs are as of dcd_overlap_shapes, and `ends` has an entry for each query that
// was submitted. All else is as in dcd_query_poll, with `found` for `hits` and `total` for `count`.
//
// Errors: as dcd_query_poll, and DCD_ERR_LIMIT (more than DCD_MAX_SUBMITTED_OVERLAPS were found; then the query is closed).
DCD_API
DcdStatus dcd_query_poll_overlaps(DcdWorld world,
                                  DcdQueryId query,
                                  DcdOverlap *found,
                                  size_t cap,
                                  size_t *ends,
                                  size_t *total);

// Closes a query whose answer is not wanted any more.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or query).
DCD_API DcdStatus dcd_query_cancel(DcdWorld world, DcdQueryId query);

// Lists the regions. Writes them to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null,
// to ask for the number.
//
// A server and a node list none: dcd_world_info has their number. In a served world that follows its load, regions change as it
// runs: ask again now and then.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
DCD_API DcdStatus dcd_regions(DcdWorld world, DcdRegionInfo *out, size_t cap, size_t *count);

// Lists the borders, in order of (a, b): one for each two regions that have a face in common or hold the same body. Writes them to
// `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the number.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_SMALL_BUFFER: `count` is written all the same, `out` is not.
// - DCD_ERR_UNSUPPORTED: in a served world, whatever the role. Ask a local one of the same cut and coupling.
DCD_API
DcdStatus dcd_borders(DcdWorld world,
                      DcdBorderInfo *out,
                      size_t cap,
                      size_t *count);

// Reads who owns a body. Nobody owns a fixed body (DCD_NO_REGION, DCD_NO_NODE, without DCD_OWNER_HERE). A server is told no owner:
// DCD_NO_REGION.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
DCD_API
DcdStatus dcd_body_owner(DcdWorld world,
                         DcdBodyId body,
                         DcdOwner *out);

// Sets the area of interest of a client or participant: what it hears of from now on. These are bodies whose origin is within
// `radius` metres of `centre` (world space), its own avatars, and bodies whose origin is within 8 m of these. Some bodies a little
// beyond the radius are told of too.
//
// - Everything. A radius of 0 or less, or of infinity, is everything, as at first. `centre` may be null then.
// - Savings. An interest saves bytes and time where the world is large, and more where the client joins with one
//   (DcdClientDef.interest_radius).
// - Long bodies. A long body whose origin is farther off may touch an avatar, and only the contact is reported (dcd_events). Give
//   a radius that has the origins of such bodies in it.
// - Moving it. Call it as often as needed: as long as the centre stays within a twentieth of the radius of where it was said last,
//   nothing is sent.
// - Bodies outside. They stay valid, at the place and velocity where they were heard of last, with DCD_STATE_OUTSIDE in
//   DcdStateView.flags and with DcdBodyInfo.outside. That they are removed or touch avatars of this process is reported all the
//   same. So is that they appear, unless the client joined with an interest.
// - Queries. What is submitted is answered from the whole world (dcd_cast_rays_submit).
// - Leaving and entering. What leaves the area is told so. What comes in, by its own motion or as the interest moves over it, is
//   told within a few steps, also when it rests by then. It counts as outside until then.
//
// A local world shows everything all the same. The interest lasts until it is set again or the world is destroyed.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: a centre that is out of range, or a radius that is NaN.
// - DCD_ERR_NETWORK: the link is gone.
// - DCD_ERR_UNSUPPORTED: a server or a node.
DCD_API
DcdStatus dcd_interest_set(DcdWorld world,
                           const double *centre,
                           double radius);

// Limits what a client or participant is sent of bodies, in bytes per second with all headers but IP's; 0: as many as the link
// carries, as at first.
//
// Where there is not room for all bodies, those are told first that are most wrong here, as seen from the process's avatars, and
// for longest. What is not told for a while is shown going on as it did, for two seconds at most (dcd_view_time). Below some 2,000
// bytes per second little is told but that time goes on. For players at home 16,000 (128 kbit/s) suits some hundred moving bodies
// near them. `dcd client --bandwidth` says what the bytes of a world are for.
//
// A local world knows all. The limit lasts until it is set again or the world is destroyed.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_NETWORK (the link is gone), DCD_ERR_UNSUPPORTED (a server or a node).
DCD_API
DcdStatus dcd_bandwidth_set(DcdWorld world,
                            uint32_t bytes_per_second);

// Reads the counters of a world.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_stats(DcdWorld world, DcdStats *out);

// Writes the counters as text for people, one per line, to `buf` of `cap` bytes with a NUL, and its size with NUL to `needed`.
// With `cap` 0, `buf` may be null, to ask for the size.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`needed` is written all the same, `buf` is not).
DCD_API DcdStatus dcd_stats_text(DcdWorld world, char *buf, size_t cap, size_t *needed);

// Checks what must hold in a local world between two steps, for tests and reports of bugs: that each body has one owner, that
// owners and regions agree on who holds what, that parts of masses add up, and that numbers are finite. It costs a look at every
// body.
//
// Writes what does not hold, one finding per line, to `buf` of `cap` bytes with a NUL, and the size with NUL to `needed`. The size
// is 1 as long as all is well. With `cap` 0, `buf` may be null, to ask for the size.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`needed` is written all the same, `buf` is not),
// DCD_ERR_UNSUPPORTED (in a served world).
DCD_API
DcdStatus dcd_validate(DcdWorld world,
                       char *buf,
                       size_t cap,
                       size_t *needed);

// Hashes the pose and velocity of every movable body to one number. Equal worlds have equal numbers, whatever the number of
// threads.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (in a served world).
DCD_API DcdStatus dcd_state_hash(DcdWorld world, uint64_t *out);

// Reads what the last dcd_step of a local world took by phase, and what there is now. Times are 0 before the first step, and for
// regions that rested.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
// - DCD_ERR_UNSUPPORTED: in a served world. There dcd_stats has the wall time of taking in what came, and the bytes of the
//   network.
DCD_API DcdStatus dcd_profile(DcdWorld world, DcdProfile *out);

// Keeps a local world in memory as it is now, to go back to: for rollback, where a game computes some ticks again with inputs that
// came late. `out` receives the checkpoint. dcd_checkpoint_destroy frees it, and dcd_world_destroy frees all of its world.
//
// Little is copied here. The next step copies the regions that it changes, each on its own thread, and none that rests. A
// checkpoint takes as much memory as what has changed since.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (a served world, which dcd_snapshot_save_file saves).
DCD_API
DcdStatus dcd_checkpoint_create(DcdWorld world,
                                DcdCheckpointId *out);

// Keeps the world anew as it is now, in place of what the checkpoint kept before. A game with rollback has one checkpoint per tick
// that it may go back, and uses them in turn.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID.
DCD_API
DcdStatus dcd_checkpoint_save(DcdWorld world,
                              DcdCheckpointId checkpoint);

// Goes back to a checkpoint of this world, as often as wanted. From there the world goes on to the same bits.
//
// - What goes back. All is as it was then: bodies, joints, regions, settings, dcd_state_view and dcd_events.
// - What stays. Threads, shapes and hooks stay as they are now, and so do other checkpoints, later ones too. A recording of the
//   world goes on from here.
// - Changes between steps. What was changed between the last step and the checkpoint is changed: dcd_state_view shows it so, and
//   the material of a body that was destroyed is 0 in dcd_events.
// - Ids. Ids of bodies and joints that were given since are given again, in the same order, so that computing a tick again gives
//   the same ones. Forget the ids that were given since.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also for a checkpoint of another world).
DCD_API DcdStatus dcd_checkpoint_restore(DcdWorld world, DcdCheckpointId checkpoint);

// Destroys a checkpoint; its world stays as it is.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice).
DCD_API DcdStatus dcd_checkpoint_destroy(DcdWorld world, DcdCheckpointId checkpoint);

// Sets where a world is looked at from, in place of what was set before. Regions farther away than what is seen from there are
// stepped less often, as DcdWorldDef.fidelity allows. Call it as often as viewers move.
//
// - Local world. Without viewpoints, as at first, all of it is looked at.
// - Server. The viewpoints count some ticks later, on all nodes from the same tick on, and are kept when the server stops. Without
//   viewpoints only clients look.
// - Source of a server. A world that is served from it (DcdServerDef.source) keeps its fidelity and viewpoints, and is looked at
//   by its clients, too (dcd_interest_set).
//
// `viewpoints` points to `count` of them, read during the call. It may be null when there are none.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: a place out of range, or a radius that is negative or NaN.
// - DCD_ERR_UNSUPPORTED: a node or a client.
// - DCD_ERR_NETWORK: the served world has ended.
DCD_API
DcdStatus dcd_viewpoints_set(DcdWorld world,
                             const DcdViewpoint *viewpoints,
                             size_t count);

// Reads what fidelity saves and costs. Where all is computed in full, share_of_full_time is 1 and the rest says nothing. The
// server of a world says what it was told last, every 60 steps. Nodes and clients do not know, and say the same as where all is
// computed in full.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_fidelity_report(DcdWorld world, DcdFidelityReport *out);

// Begins to record a local world to a file. The recording holds a snapshot of the world as it is now, what is done to it from now
// on, and a digest of each region after each step. From that, `dcd replay FILE` computes the world again, bit for bit, and `dcd
// diff` finds where two recordings differ.
//
// - Writing. A thread of the library writes the file. A crash loses the last tenth of a second. A file that is there is replaced,
//   unless another recording is being written to it.
// - Former recording. A recording that was going on ends. If that one is not whole, the call says so (DCD_ERR_IO) and begins none:
//   repeat it then.
// - End. dcd_record_stop tells whether all is written. dcd_world_destroy ends a recording too, but can only log that it is not
//   whole: call dcd_record_stop first.
//
// Servers, nodes and participants are recorded from their beginning, by `record_path` of DcdServerDef, DcdNodeDef and
// DcdParticipantDef.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_UNSUPPORTED (in a served world).
DCD_API
DcdStatus dcd_record(DcdWorld world,
                     const char *path);

// Begins to record a local world in memory, for "what happened just now?". It keeps at least the last `seconds` of the world by
// the clock on the wall, about twice as much at most; dcd_record_keep writes them. Each stretch of so many seconds begins with a
// snapshot. A recording that was going on ends as by dcd_record.
//
// Errors: DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (`seconds` that are not above 0 and up to 86,400), DCD_ERR_IO (the recording before is
// not whole), DCD_ERR_UNSUPPORTED (in a served world).
DCD_API
DcdStatus dcd_record_last(DcdWorld world,
                          float seconds);

// Writes to a file what dcd_record_last has kept, and goes on recording. A file that is there is replaced once the new one is
// whole. A symbolic link stays, and the file that it leads to is replaced. Devices, pipes and folders are refused.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_ARGUMENT (nothing is recorded in memory), DCD_ERR_UNSUPPORTED (in a
// served world).
DCD_API DcdStatus dcd_record_keep(DcdWorld world, const char *path);

// Ends the recording of a local world, and waits until it is written. It does nothing where nothing is recorded, and in a served
// world.
//
// Errors: DCD_ERR_STALE_ID, DCD_ERR_IO (a part of the recording could not be written: the file ends there).
DCD_API DcdStatus dcd_record_stop(DcdWorld world);

// Saves a snapshot of a world: bodies, joints, contacts, regions, settings. A local world goes on from there to the same bits, in
// this program or another one of the same build. Handles of shapes, views, and the user_data of the world are not part of it.
//
// A server saves the world as it is after one tick, for which its nodes stop for some ticks. The snapshot is that of a local
// world, avatars too, without contacts. What the server's program did since its last dcd_step is not in it. The call waits for
// half a minute at most.
//
// Writes the bytes to `buf` of `cap` bytes, and their number to `needed`. With `cap` 0, `buf` may be null, to ask for the number,
// which costs as much as saving. While nothing changes the number stays the same. A served world changes: save it to a file.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_SMALL_BUFFER: `needed` is written all the same, `buf` is not.
// - DCD_ERR_TIMEOUT: nodes do not answer their server.
// - DCD_ERR_UNSUPPORTED: a client, participant or node.
DCD_API DcdStatus dcd_snapshot_save(DcdWorld world, void *buf, size_t cap, size_t *needed);

// Saves a world to a file, as dcd_snapshot_save does. `dcd run` goes on with such a file, and writes them by --save. A file that
// is there is replaced once the new one is whole. A symbolic link stays, and the file that it leads to is replaced. Devices, pipes
// and folders are refused.
//
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO.
// - DCD_ERR_TIMEOUT: nodes do not answer their server.
// - DCD_ERR_UNSUPPORTED: a client, participant or node.
DCD_API
DcdStatus dcd_snapshot_save_file(DcdWorld world,
                                 const char *path);

// Restores a snapshot of `size` bytes into a world: into the one that it was saved from, to go back, or into any other, which
// loses what it held. Threads and shapes stay those of this world. All else is as saved, gravity and regions too.
//
// - Ids. Ids of bodies and joints that this world gave are valid if the saved world has them, else stale. If
//   the snapshot is of another world, other bodies may have them: then forget all ids. dcd_body_at finds bodies by number.
// - Later ids. Ids that are given later are new. Where something was made since the save, what is made now gets other ids than it
//   got then. A world of several regions then goes on to other bits, since how contacts are found again at a border depends on ids.
//   To go back and on to the same bits whatever was made, use dcd_checkpoint_create.
// - Views. dcd_state_view and dcd_events are as after the last step before saving, except for the user_data of bodies that were
//   destroyed, which is 0.
// - Server. Its world goes on with the bodies and joints of the snapshot, for all nodes and clients. Its ticks and regions go on,
//   and tick length and gravity must be the same. What its program did since its last dcd_step is dropped. Avatars are their
//   clients': those that are in both go where they were, and none comes or goes.
//
// `data` is read during the call. After an error the world is as it was. Damage is found; malice is not: load nothing that is not
// trusted.
// Errors:
// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
// - DCD_ERR_ARGUMENT: bytes that are no snapshot, or damaged.
// - DCD_ERR_VERSION: a snapshot of another build of the library.
// - DCD_ERR_UNSUPPORTED: a client, participant or node.
DCD_API
DcdStatus dcd_snapshot_load(DcdWorld world,
                            const void *data,
                            size_t size);

// Restores a snapshot from a file into a world, as dcd_snapshot_load does.
//
// Errors: as dcd_snapshot_load, and DCD_ERR_IO (the file cannot be read).
DCD_API DcdStatus dcd_snapshot_load_file(DcdWorld world, const char *path);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus


/* Default values of each struct. */

/* One region, a thread per core, Earth's gravity, 60 steps per second, a box of 128 m around the origin, up to 400 m/s. */
#define DCD_WORLD_DEF_INIT \
    { (uint32_t)sizeof(DcdWorldDef), 0, 0, 4, { 0.0f, -9.81f, 0.0f }, 1.0f / 60.0f, \
      { -64.0, -64.0, -64.0 }, { 64.0, 64.0, 64.0 }, 0, 0, 0, 0, 0, 0, 0.0f, 0, 0.0f, 0, 0.0f, NULL, 0, 0 }

/* A dynamic body as dense as water at the origin. */
#define DCD_BODY_DEF_INIT \
    { (uint32_t)sizeof(DcdBodyDef), DCD_DYNAMIC, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }, { 0 }, 1000.0f, 0.0f, 0.5f, 0.0f, 0, 0, 0.0f, \
      0.0f, 0.0f, 1.0f, 0, 0, 0, 0.0f, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 7, 0, 0.0f, \
      0.05f, 0.5f, 0.5f, 0.0f, { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, 0, 0, 0, 0, 0 }

/* A person of 80 kg: steps of 0.3 m, slopes of 45 degrees. */
#define DCD_CHARACTER_DEF_INIT \
    { (uint32_t)sizeof(DcdCharacterDef), 0.3f, 0.1f, 0.785398163f, 0.785398163f, 0.2f, 0.02f, 80.0f, 0 }

/* A wheel of a car of a tonne, forward along x, upward along y: neither driven nor steered. */
#define DCD_WHEEL_INIT \
    { { 0.0f, 0.0f, 0.0f }, { 0.0f, -1.0f, 0.0f }, { 0.0f, 0.0f, 1.0f }, 0.3f, 0.2f, 0.35f, 30.0f, 4.0f, 5.0f, 20000.0f, \
      1.5f, 1.0f, 0.0f, 4000.0f, 0.0f }

/* A car of 3.2 x 1.6 m and about a tonne, up to 20 m/s. */
#define DCD_VEHICLE_DEF_INIT \
    { (uint32_t)sizeof(DcdVehicleDef), 0, NULL, 20.0f, 0 }

/* At the origin: 100 N s/m² within 5 m, down to nothing at 10 m. */
#define DCD_EXPLOSION_INIT \
    { (uint32_t)sizeof(DcdExplosion), 0xFFFFFFFFu, { 0.0, 0.0, 0.0 }, 5.0f, 5.0f, 100.0f, 0 }

/* Still water without end, up to the height of the origin. */
#define DCD_FLUID_INIT \
    { (uint32_t)sizeof(DcdFluid), 0xFFFFFFFFu, { -1.0e9, -1.0e9, -1.0e9 }, { 1.0e9, 1.0e9, 1.0e9 }, 0.0, 1000.0f, \
      { 0.0f, 0.0f, 0.0f }, 1.0f, 1.0f, 0.0f, 0 }

/* A shape as dense as water at the body's origin. */
#define DCD_COLLIDER_PROPERTIES_INIT \
    { (uint32_t)sizeof(DcdColliderProperties), 0, { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \
      1000.0f, 0.0f, 0.5f, 0.0f, 0, 0, 0.0f, 0, 0.0f, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 7, 0, 0 }

/* A motor that holds still by any force. */
#define DCD_JOINT_MOTOR_INIT { 0.0f, 0.0f, 0.0f, 1000.0f, 3.402823466e+38f, DCD_MOTOR_ACCELERATION }

/* A fixed joint that brings the origins of two bodies together. */
#define DCD_JOINT_DEF_INIT \
    { (uint32_t)sizeof(DcdJointDef), DCD_JOINT_FIXED, { 0 }, { 0 }, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0.0f, 0.0f }, DCD_JOINT_MOTOR_INIT, \
      0, 0, 0, 1.0e6f, 1.0f, 0, 0 }

/* A filter that every body passes. */
#define DCD_FILTER_INIT { (uint32_t)sizeof(DcdFilter), 0, 0, 0xFFFFFFFFu, NULL, 0 }
#define DCD_RAY_INIT { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 1.0e6f, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_SHAPE_CAST_INIT \
    { { 0 }, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, \
      0.0f, 0xFFFFFFFFu, { 0 }, 0, 0 }
#define DCD_POINT_QUERY_INIT { { 0.0, 0.0, 0.0 }, 1.0e6f, 0xFFFFFFFFu, { 0 }, 0, 0 }
#define DCD_SHAPE_QUERY_INIT \
    { { 0 }, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_BOX_QUERY_INIT { { 0.0, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }, { 0 }, 0xFFFFFFFFu, 0 }

/* Draws shapes, without a bound in space; set its functions. */
#define DCD_DEBUG_DRAW_INIT \
    { (uint32_t)sizeof(DcdDebugDraw), DCD_DRAW_SHAPES, NULL, NULL, NULL, NULL, NULL, NULL, \
      { -1.0e300, -1.0e300, -1.0e300 }, { 1.0e300, 1.0e300, 1.0e300 }, 0.1f, 1.0e-4f }

/* Ten seconds of patience, no identity file; one thread per core. */
#define DCD_CLIENT_DEF_INIT \
    { (uint32_t)sizeof(DcdClientDef), 10000, NULL, NULL, NULL, 0, { 0.0, 0.0, 0.0 }, 0.0, 0, 0 }
#define DCD_PARTICIPANT_DEF_INIT \
    { (uint32_t)sizeof(DcdParticipantDef), 10000, NULL, NULL, NULL, 0, 0, 0, { 0.0, 0.0, 0.0 }, 0.0, NULL, NULL }

/* All nodes in one group and in step; a server in real time that waits for one node, on a free port of this machine, and tells states
 * of every third step. */
#define DCD_GROUP_DEF_INIT \
    { (uint32_t)sizeof(DcdGroupDef), 0, 0.0f, 0.0f, 0.1f, 32 }
#define DCD_SERVER_DEF_INIT \
    { (uint32_t)sizeof(DcdServerDef), 1, NULL, NULL, 0, NULL, { 0 }, NULL, "127.0.0.1:0", NULL, 0, \
      20.0f, 0, 0, 3, 0.0f, NULL, NULL, NULL, 3600.0f, 0 }
#define DCD_NODE_DEF_INIT \
    { (uint32_t)sizeof(DcdNodeDef), 10000, NULL, NULL, NULL, NULL, 0, 0, 0, NULL, NULL, NULL }

/* Structs that are written by the library. */
#define DCD_WORLD_INFO_INIT \
    { (uint32_t)sizeof(DcdWorldInfo), 0, 0, 0, 0, 0.0f, { 0.0f, 0.0f, 0.0f }, 0, 0.0f, 0 }
#define DCD_BODY_INFO_INIT \
    { (uint32_t)sizeof(DcdBodyInfo), 0, 0, { 0.0, 0.0, 0.0 }, 0.0f, 0, { 0.0f, 0.0f, 0.0f }, \
      { 0.0f, 0.0f, 0.0f }, 0, false, false, { 0, 0 } }
#define DCD_CHARACTER_STATE_INIT \
    { (uint32_t)sizeof(DcdCharacterState), false, false, { 0, 0 }, \
      { { 0 }, 0, { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 0.0f, 0, 0 } }
#define DCD_SHAPE_INFO_INIT \
    { (uint32_t)sizeof(DcdShapeInfo), 0, { 0.0f, 0.0f, 0.0f }, 0.0f, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, 0, 0, 0, 0, 0, 0 }
#define DCD_SETTINGS_INIT \
    { (uint32_t)sizeof(DcdSettings), 0, { 0.0f, 0.0f, 0.0f }, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, \
      0.0f, 0.0f, 0, 0, 0.0f, 0 }
#define DCD_FIDELITY_REPORT_INIT \
    { (uint32_t)sizeof(DcdFidelityReport), 0.0f, 0.0f, 0.0f, 0.0, 0, 0, { 0, 0, 0 }, 0 }
#define DCD_PROFILE_INIT \
    { (uint32_t)sizeof(DcdProfile), 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, 0, 0, 0 }
/* No hooks: set those that the library is to call. */
#define DCD_HOOKS_INIT { (uint32_t)sizeof(DcdHooks), 0, NULL, NULL, NULL, NULL }
#define DCD_TASKS_INIT { (uint32_t)sizeof(DcdTasks), 0, NULL, NULL, NULL }
#define DCD_BODY_EXTENT_INIT \
    { (uint32_t)sizeof(DcdBodyExtent), 0.0f, { 0.0, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, \
      { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }
#define DCD_BODY_PROPERTIES_INIT \
    { (uint32_t)sizeof(DcdBodyProperties), 0, 0, 0, 0, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, \
      { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, 0, 0, 0, 0 }
#define DCD_JOINT_INFO_INIT \
    { (uint32_t)sizeof(DcdJointInfo), 0, { 0 }, { 0 }, 0, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 0.0f } }, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 0.0f } }, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 0.0f } }, 0.0f, \
      { 0.0f, 0.0f, 0.0f }, 0.0f, 0.0f, 0, 0, 0, 0, 0 }
#define DCD_STATE_VIEW_INIT \
    { (uint32_t)sizeof(DcdStateView), 0, 0, 0, NULL, NULL, NULL, NULL, NULL, NULL, NULL }
#define DCD_VIEW_TIME_INIT { (uint32_t)sizeof(DcdViewTime), 0, 0.0, 0.0, 0.0, -1.0, -1.0 }
#define DCD_PREDICTION_INIT { (uint32_t)sizeof(DcdPrediction), 0, 0, 0, 0, 0.0, 0.0, 0.0 }
#define DCD_EVENT_VIEW_INIT \
    { (uint32_t)sizeof(DcdEventView), 0, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, \
      NULL, 0, NULL, 0, NULL, 0 }
#define DCD_OWNER_INIT { (uint32_t)sizeof(DcdOwner), 0, 0, 0, 0 }
#define DCD_CONNECTION_INFO_INIT \
    { (uint32_t)sizeof(DcdConnectionInfo), 0, 0, 0, 0, 0.0f, 0.0, 0.0, 0, 0, 0, 0, 0, 0, 0, 0 }
#define DCD_STATS_INIT \
    { (uint32_t)sizeof(DcdStats), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.0, 0.0, 0.0f, 0 }

/* Whether the library that runs fits this header: DCD_OK or DCD_ERR_VERSION. Before 1.0 the minor version must match too. */
static inline DcdStatus dcd_version_check(void)
{
    return dcd_version() / 1000u == DCD_VERSION / 1000u ? DCD_OK : DCD_ERR_VERSION;
}

/* The library's own layout, on 64-bit systems: a compiler that differs says so here. */
#if UINTPTR_MAX == 0xFFFFFFFFFFFFFFFFu
#ifdef __cplusplus
#define DCD_ASSERT_(what) static_assert(what, #what)
#else
#define DCD_ASSERT_(what) _Static_assert(what, #what)
#endif
DCD_ASSERT_(sizeof(DcdWorld) == 8);
DCD_ASSERT_(offsetof(DcdWorld, v) == 0);
DCD_ASSERT_(sizeof(DcdBodyId) == 8);
DCD_ASSERT_(offsetof(DcdBodyId, v) == 0);
DCD_ASSERT_(sizeof(DcdShapeId) == 8);
DCD_ASSERT_(offsetof(DcdShapeId, v) == 0);
DCD_ASSERT_(sizeof(DcdJointId) == 8);
DCD_ASSERT_(offsetof(DcdJointId, v) == 0);
DCD_ASSERT_(sizeof(DcdConnectionId) == 8);
DCD_ASSERT_(offsetof(DcdConnectionId, v) == 0);
DCD_ASSERT_(sizeof(DcdPose) == 40);
DCD_ASSERT_(offsetof(DcdPose, p) == 0);
DCD_ASSERT_(offsetof(DcdPose, q) == 24);
DCD_ASSERT_(sizeof(DcdVelocity) == 24);
DCD_ASSERT_(offsetof(DcdVelocity, linear) == 0);
DCD_ASSERT_(offsetof(DcdVelocity, angular) == 12);
DCD_ASSERT_(sizeof(DcdFrame) == 28);
DCD_ASSERT_(offsetof(DcdFrame, p) == 0);
DCD_ASSERT_(offsetof(DcdFrame, q) == 12);
DCD_ASSERT_(sizeof(DcdWorldDef) == 144);
DCD_ASSERT_(offsetof(DcdWorldDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdWorldDef, threads) == 4);
DCD_ASSERT_(offsetof(DcdWorldDef, regions) == 8);
DCD_ASSERT_(offsetof(DcdWorldDef, solver_iterations) == 12);
DCD_ASSERT_(offsetof(DcdWorldDef, gravity) == 16);
DCD_ASSERT_(offsetof(DcdWorldDef, dt) == 28);
DCD_ASSERT_(offsetof(DcdWorldDef, min) == 32);
DCD_ASSERT_(offsetof(DcdWorldDef, max) == 56);
DCD_ASSERT_(offsetof(DcdWorldDef, user_data) == 80);
DCD_ASSERT_(offsetof(DcdWorldDef, coupling) == 88);
DCD_ASSERT_(offsetof(DcdWorldDef, preset) == 92);
DCD_ASSERT_(offsetof(DcdWorldDef, exchanges) == 96);
DCD_ASSERT_(offsetof(DcdWorldDef, depth) == 100);
DCD_ASSERT_(offsetof(DcdWorldDef, island_limit) == 104);
DCD_ASSERT_(offsetof(DcdWorldDef, tolerance) == 108);
DCD_ASSERT_(offsetof(DcdWorldDef, axes) == 112);
DCD_ASSERT_(offsetof(DcdWorldDef, speed_limit) == 116);
DCD_ASSERT_(offsetof(DcdWorldDef, fidelity) == 120);
DCD_ASSERT_(offsetof(DcdWorldDef, fidelity_limit) == 124);
DCD_ASSERT_(offsetof(DcdWorldDef, cuts) == 128);
DCD_ASSERT_(offsetof(DcdWorldDef, cut_count) == 136);
DCD_ASSERT_(offsetof(DcdWorldDef, reserved) == 140);
DCD_ASSERT_(sizeof(DcdCut) == 16);
DCD_ASSERT_(offsetof(DcdCut, at) == 0);
DCD_ASSERT_(offsetof(DcdCut, axis) == 8);
DCD_ASSERT_(offsetof(DcdCut, reserved) == 12);
DCD_ASSERT_(sizeof(DcdWorldInfo) == 56);
DCD_ASSERT_(offsetof(DcdWorldInfo, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdWorldInfo, role) == 4);
DCD_ASSERT_(offsetof(DcdWorldInfo, tick) == 8);
DCD_ASSERT_(offsetof(DcdWorldInfo, user_data) == 16);
DCD_ASSERT_(offsetof(DcdWorldInfo, regions) == 24);
DCD_ASSERT_(offsetof(DcdWorldInfo, dt) == 28);
DCD_ASSERT_(offsetof(DcdWorldInfo, gravity) == 32);
DCD_ASSERT_(offsetof(DcdWorldInfo, client) == 44);
DCD_ASSERT_(offsetof(DcdWorldInfo, speed_limit) == 48);
DCD_ASSERT_(offsetof(DcdWorldInfo, reserved) == 52);
DCD_ASSERT_(sizeof(DcdClientDef) == 80);
DCD_ASSERT_(offsetof(DcdClientDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdClientDef, timeout_ms) == 4);
DCD_ASSERT_(offsetof(DcdClientDef, server) == 8);
DCD_ASSERT_(offsetof(DcdClientDef, token) == 16);
DCD_ASSERT_(offsetof(DcdClientDef, identity_path) == 24);
DCD_ASSERT_(offsetof(DcdClientDef, user_data) == 32);
DCD_ASSERT_(offsetof(DcdClientDef, interest_centre) == 40);
DCD_ASSERT_(offsetof(DcdClientDef, interest_radius) == 64);
DCD_ASSERT_(offsetof(DcdClientDef, give_up_ms) == 72);
DCD_ASSERT_(offsetof(DcdClientDef, reserved) == 76);
DCD_ASSERT_(sizeof(DcdParticipantDef) == 96);
DCD_ASSERT_(offsetof(DcdParticipantDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdParticipantDef, timeout_ms) == 4);
DCD_ASSERT_(offsetof(DcdParticipantDef, server) == 8);
DCD_ASSERT_(offsetof(DcdParticipantDef, token) == 16);
DCD_ASSERT_(offsetof(DcdParticipantDef, identity_path) == 24);
DCD_ASSERT_(offsetof(DcdParticipantDef, user_data) == 32);
DCD_ASSERT_(offsetof(DcdParticipantDef, threads) == 40);
DCD_ASSERT_(offsetof(DcdParticipantDef, give_up_ms) == 44);
DCD_ASSERT_(offsetof(DcdParticipantDef, interest_centre) == 48);
DCD_ASSERT_(offsetof(DcdParticipantDef, interest_radius) == 72);
DCD_ASSERT_(offsetof(DcdParticipantDef, record_path) == 80);
DCD_ASSERT_(offsetof(DcdParticipantDef, metrics) == 88);
DCD_ASSERT_(sizeof(DcdGroupDef) == 24);
DCD_ASSERT_(offsetof(DcdGroupDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdGroupDef, lag_ticks) == 4);
DCD_ASSERT_(offsetof(DcdGroupDef, near_ms) == 8);
DCD_ASSERT_(offsetof(DcdGroupDef, far_ms) == 12);
DCD_ASSERT_(offsetof(DcdGroupDef, agree) == 16);
DCD_ASSERT_(offsetof(DcdGroupDef, size) == 20);
DCD_ASSERT_(sizeof(DcdServerDef) == 136);
DCD_ASSERT_(offsetof(DcdServerDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdServerDef, nodes) == 4);
DCD_ASSERT_(offsetof(DcdServerDef, scene) == 8);
DCD_ASSERT_(offsetof(DcdServerDef, params) == 16);
DCD_ASSERT_(offsetof(DcdServerDef, param_count) == 24);
DCD_ASSERT_(offsetof(DcdServerDef, world) == 32);
DCD_ASSERT_(offsetof(DcdServerDef, source) == 40);
DCD_ASSERT_(offsetof(DcdServerDef, groups) == 48);
DCD_ASSERT_(offsetof(DcdServerDef, listen) == 56);
DCD_ASSERT_(offsetof(DcdServerDef, data_path) == 64);
DCD_ASSERT_(offsetof(DcdServerDef, last_tick) == 72);
DCD_ASSERT_(offsetof(DcdServerDef, avatar_speed) == 80);
DCD_ASSERT_(offsetof(DcdServerDef, flags) == 84);
DCD_ASSERT_(offsetof(DcdServerDef, user_data) == 88);
DCD_ASSERT_(offsetof(DcdServerDef, state_every) == 96);
DCD_ASSERT_(offsetof(DcdServerDef, verify) == 100);
DCD_ASSERT_(offsetof(DcdServerDef, metrics) == 104);
DCD_ASSERT_(offsetof(DcdServerDef, directory) == 112);
DCD_ASSERT_(offsetof(DcdServerDef, record_path) == 120);
DCD_ASSERT_(offsetof(DcdServerDef, avatar_expiry) == 128);
DCD_ASSERT_(offsetof(DcdServerDef, reserved) == 132);
DCD_ASSERT_(sizeof(DcdNodeDef) == 80);
DCD_ASSERT_(offsetof(DcdNodeDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdNodeDef, timeout_ms) == 4);
DCD_ASSERT_(offsetof(DcdNodeDef, server) == 8);
DCD_ASSERT_(offsetof(DcdNodeDef, token) == 16);
DCD_ASSERT_(offsetof(DcdNodeDef, identity_path) == 24);
DCD_ASSERT_(offsetof(DcdNodeDef, listen) == 32);
DCD_ASSERT_(offsetof(DcdNodeDef, user_data) == 40);
DCD_ASSERT_(offsetof(DcdNodeDef, threads) == 48);
DCD_ASSERT_(offsetof(DcdNodeDef, give_up_ms) == 52);
DCD_ASSERT_(offsetof(DcdNodeDef, record_path) == 56);
DCD_ASSERT_(offsetof(DcdNodeDef, metrics) == 64);
DCD_ASSERT_(offsetof(DcdNodeDef, advertise) == 72);
DCD_ASSERT_(sizeof(DcdBodyDef) == 232);
DCD_ASSERT_(offsetof(DcdBodyDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdBodyDef, body_type) == 4);
DCD_ASSERT_(offsetof(DcdBodyDef, pose) == 8);
DCD_ASSERT_(offsetof(DcdBodyDef, velocity) == 48);
DCD_ASSERT_(offsetof(DcdBodyDef, shape) == 72);
DCD_ASSERT_(offsetof(DcdBodyDef, density) == 80);
DCD_ASSERT_(offsetof(DcdBodyDef, mass) == 84);
DCD_ASSERT_(offsetof(DcdBodyDef, friction) == 88);
DCD_ASSERT_(offsetof(DcdBodyDef, restitution) == 92);
DCD_ASSERT_(offsetof(DcdBodyDef, friction_rule) == 96);
DCD_ASSERT_(offsetof(DcdBodyDef, restitution_rule) == 100);
DCD_ASSERT_(offsetof(DcdBodyDef, contact_skin) == 104);
DCD_ASSERT_(offsetof(DcdBodyDef, linear_damping) == 108);
DCD_ASSERT_(offsetof(DcdBodyDef, angular_damping) == 112);
DCD_ASSERT_(offsetof(DcdBodyDef, gravity_scale) == 116);
DCD_ASSERT_(offsetof(DcdBodyDef, flags) == 120);
DCD_ASSERT_(offsetof(DcdBodyDef, locked) == 124);
DCD_ASSERT_(offsetof(DcdBodyDef, events) == 128);
DCD_ASSERT_(offsetof(DcdBodyDef, force_threshold) == 132);
DCD_ASSERT_(offsetof(DcdBodyDef, groups) == 136);
DCD_ASSERT_(offsetof(DcdBodyDef, mask) == 140);
DCD_ASSERT_(offsetof(DcdBodyDef, solver_groups) == 144);
DCD_ASSERT_(offsetof(DcdBodyDef, solver_mask) == 148);
DCD_ASSERT_(offsetof(DcdBodyDef, pairs) == 152);
DCD_ASSERT_(offsetof(DcdBodyDef, dominance) == 156);
DCD_ASSERT_(offsetof(DcdBodyDef, soft_ccd) == 160);
DCD_ASSERT_(offsetof(DcdBodyDef, sleep_linear) == 164);
DCD_ASSERT_(offsetof(DcdBodyDef, sleep_angular) == 168);
DCD_ASSERT_(offsetof(DcdBodyDef, sleep_after) == 172);
DCD_ASSERT_(offsetof(DcdBodyDef, extra_mass) == 176);
DCD_ASSERT_(offsetof(DcdBodyDef, extra_centre) == 180);
DCD_ASSERT_(offsetof(DcdBodyDef, extra_inertia) == 192);
DCD_ASSERT_(offsetof(DcdBodyDef, extra_solver_iterations) == 204);
DCD_ASSERT_(offsetof(DcdBodyDef, extra_pgs_iterations) == 208);
DCD_ASSERT_(offsetof(DcdBodyDef, hooks) == 212);
DCD_ASSERT_(offsetof(DcdBodyDef, user_data) == 216);
DCD_ASSERT_(offsetof(DcdBodyDef, material) == 224);
DCD_ASSERT_(sizeof(DcdCharacterDef) == 36);
DCD_ASSERT_(offsetof(DcdCharacterDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdCharacterDef, step_height) == 4);
DCD_ASSERT_(offsetof(DcdCharacterDef, step_depth) == 8);
DCD_ASSERT_(offsetof(DcdCharacterDef, max_climb) == 12);
DCD_ASSERT_(offsetof(DcdCharacterDef, min_slide) == 16);
DCD_ASSERT_(offsetof(DcdCharacterDef, snap) == 20);
DCD_ASSERT_(offsetof(DcdCharacterDef, gap) == 24);
DCD_ASSERT_(offsetof(DcdCharacterDef, mass) == 28);
DCD_ASSERT_(offsetof(DcdCharacterDef, reserved) == 32);
DCD_ASSERT_(sizeof(DcdWheel) == 84);
DCD_ASSERT_(offsetof(DcdWheel, at) == 0);
DCD_ASSERT_(offsetof(DcdWheel, down) == 12);
DCD_ASSERT_(offsetof(DcdWheel, axle) == 24);
DCD_ASSERT_(offsetof(DcdWheel, rest_length) == 36);
DCD_ASSERT_(offsetof(DcdWheel, travel) == 40);
DCD_ASSERT_(offsetof(DcdWheel, radius) == 44);
DCD_ASSERT_(offsetof(DcdWheel, stiffness) == 48);
DCD_ASSERT_(offsetof(DcdWheel, compression) == 52);
DCD_ASSERT_(offsetof(DcdWheel, relaxation) == 56);
DCD_ASSERT_(offsetof(DcdWheel, max_force) == 60);
DCD_ASSERT_(offsetof(DcdWheel, grip) == 64);
DCD_ASSERT_(offsetof(DcdWheel, side_grip) == 68);
DCD_ASSERT_(offsetof(DcdWheel, engine_force) == 72);
DCD_ASSERT_(offsetof(DcdWheel, brake_force) == 76);
DCD_ASSERT_(offsetof(DcdWheel, steering) == 80);
DCD_ASSERT_(sizeof(DcdVehicleDef) == 24);
DCD_ASSERT_(offsetof(DcdVehicleDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdVehicleDef, wheel_count) == 4);
DCD_ASSERT_(offsetof(DcdVehicleDef, wheels) == 8);
DCD_ASSERT_(offsetof(DcdVehicleDef, top_speed) == 16);
DCD_ASSERT_(offsetof(DcdVehicleDef, reserved) == 20);
DCD_ASSERT_(sizeof(DcdDrive) == 12);
DCD_ASSERT_(offsetof(DcdDrive, throttle) == 0);
DCD_ASSERT_(offsetof(DcdDrive, brake) == 4);
DCD_ASSERT_(offsetof(DcdDrive, steering) == 8);
DCD_ASSERT_(sizeof(DcdGround) == 64);
DCD_ASSERT_(offsetof(DcdGround, body) == 0);
DCD_ASSERT_(offsetof(DcdGround, material) == 8);
DCD_ASSERT_(offsetof(DcdGround, point) == 16);
DCD_ASSERT_(offsetof(DcdGround, normal) == 40);
DCD_ASSERT_(offsetof(DcdGround, slope) == 52);
DCD_ASSERT_(offsetof(DcdGround, collider) == 56);
DCD_ASSERT_(offsetof(DcdGround, reserved) == 60);
DCD_ASSERT_(sizeof(DcdCharacterState) == 72);
DCD_ASSERT_(offsetof(DcdCharacterState, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdCharacterState, grounded) == 4);
DCD_ASSERT_(offsetof(DcdCharacterState, sliding) == 5);
DCD_ASSERT_(offsetof(DcdCharacterState, reserved) == 6);
DCD_ASSERT_(offsetof(DcdCharacterState, ground) == 8);
DCD_ASSERT_(sizeof(DcdWheelState) == 120);
DCD_ASSERT_(offsetof(DcdWheelState, pose) == 0);
DCD_ASSERT_(offsetof(DcdWheelState, suspension) == 40);
DCD_ASSERT_(offsetof(DcdWheelState, steering) == 44);
DCD_ASSERT_(offsetof(DcdWheelState, rolled) == 48);
DCD_ASSERT_(offsetof(DcdWheelState, spin) == 52);
DCD_ASSERT_(offsetof(DcdWheelState, ground) == 56);
DCD_ASSERT_(sizeof(DcdBodyProperties) == 96);
DCD_ASSERT_(offsetof(DcdBodyProperties, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdBodyProperties, body_type) == 4);
DCD_ASSERT_(offsetof(DcdBodyProperties, flags) == 8);
DCD_ASSERT_(offsetof(DcdBodyProperties, locked) == 12);
DCD_ASSERT_(offsetof(DcdBodyProperties, dominance) == 16);
DCD_ASSERT_(offsetof(DcdBodyProperties, linear_damping) == 20);
DCD_ASSERT_(offsetof(DcdBodyProperties, angular_damping) == 24);
DCD_ASSERT_(offsetof(DcdBodyProperties, gravity_scale) == 28);
DCD_ASSERT_(offsetof(DcdBodyProperties, soft_ccd) == 32);
DCD_ASSERT_(offsetof(DcdBodyProperties, sleep_linear) == 36);
DCD_ASSERT_(offsetof(DcdBodyProperties, sleep_angular) == 40);
DCD_ASSERT_(offsetof(DcdBodyProperties, sleep_after) == 44);
DCD_ASSERT_(offsetof(DcdBodyProperties, extra_mass) == 48);
DCD_ASSERT_(offsetof(DcdBodyProperties, extra_centre) == 52);
DCD_ASSERT_(offsetof(DcdBodyProperties, extra_inertia) == 64);
DCD_ASSERT_(offsetof(DcdBodyProperties, extra_solver_iterations) == 76);
DCD_ASSERT_(offsetof(DcdBodyProperties, extra_pgs_iterations) == 80);
DCD_ASSERT_(offsetof(DcdBodyProperties, reserved) == 84);
DCD_ASSERT_(offsetof(DcdBodyProperties, user_data) == 88);
DCD_ASSERT_(sizeof(DcdColliderProperties) == 104);
DCD_ASSERT_(offsetof(DcdColliderProperties, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdColliderProperties, flags) == 4);
DCD_ASSERT_(offsetof(DcdColliderProperties, frame) == 8);
DCD_ASSERT_(offsetof(DcdColliderProperties, density) == 36);
DCD_ASSERT_(offsetof(DcdColliderProperties, mass) == 40);
DCD_ASSERT_(offsetof(DcdColliderProperties, friction) == 44);
DCD_ASSERT_(offsetof(DcdColliderProperties, restitution) == 48);
DCD_ASSERT_(offsetof(DcdColliderProperties, friction_rule) == 52);
DCD_ASSERT_(offsetof(DcdColliderProperties, restitution_rule) == 56);
DCD_ASSERT_(offsetof(DcdColliderProperties, contact_skin) == 60);
DCD_ASSERT_(offsetof(DcdColliderProperties, events) == 64);
DCD_ASSERT_(offsetof(DcdColliderProperties, force_threshold) == 68);
DCD_ASSERT_(offsetof(DcdColliderProperties, groups) == 72);
DCD_ASSERT_(offsetof(DcdColliderProperties, mask) == 76);
DCD_ASSERT_(offsetof(DcdColliderProperties, solver_groups) == 80);
DCD_ASSERT_(offsetof(DcdColliderProperties, solver_mask) == 84);
DCD_ASSERT_(offsetof(DcdColliderProperties, pairs) == 88);
DCD_ASSERT_(offsetof(DcdColliderProperties, hooks) == 92);
DCD_ASSERT_(offsetof(DcdColliderProperties, user_data) == 96);
DCD_ASSERT_(sizeof(DcdBodyInfo) == 80);
DCD_ASSERT_(offsetof(DcdBodyInfo, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdBodyInfo, body_type) == 4);
DCD_ASSERT_(offsetof(DcdBodyInfo, user_data) == 8);
DCD_ASSERT_(offsetof(DcdBodyInfo, centre) == 16);
DCD_ASSERT_(offsetof(DcdBodyInfo, mass) == 40);
DCD_ASSERT_(offsetof(DcdBodyInfo, region) == 44);
DCD_ASSERT_(offsetof(DcdBodyInfo, force) == 48);
DCD_ASSERT_(offsetof(DcdBodyInfo, torque) == 60);
DCD_ASSERT_(offsetof(DcdBodyInfo, colliders) == 72);
DCD_ASSERT_(offsetof(DcdBodyInfo, sleeping) == 76);
DCD_ASSERT_(offsetof(DcdBodyInfo, outside) == 77);
DCD_ASSERT_(offsetof(DcdBodyInfo, reserved) == 78);
DCD_ASSERT_(sizeof(DcdForce) == 24);
DCD_ASSERT_(offsetof(DcdForce, force) == 0);
DCD_ASSERT_(offsetof(DcdForce, torque) == 12);
DCD_ASSERT_(sizeof(DcdExplosion) == 48);
DCD_ASSERT_(offsetof(DcdExplosion, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdExplosion, mask) == 4);
DCD_ASSERT_(offsetof(DcdExplosion, centre) == 8);
DCD_ASSERT_(offsetof(DcdExplosion, radius) == 32);
DCD_ASSERT_(offsetof(DcdExplosion, falloff) == 36);
DCD_ASSERT_(offsetof(DcdExplosion, impulse) == 40);
DCD_ASSERT_(offsetof(DcdExplosion, reserved) == 44);
DCD_ASSERT_(sizeof(DcdFluid) == 96);
DCD_ASSERT_(offsetof(DcdFluid, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdFluid, mask) == 4);
DCD_ASSERT_(offsetof(DcdFluid, min) == 8);
DCD_ASSERT_(offsetof(DcdFluid, max) == 32);
DCD_ASSERT_(offsetof(DcdFluid, surface) == 56);
DCD_ASSERT_(offsetof(DcdFluid, density) == 64);
DCD_ASSERT_(offsetof(DcdFluid, velocity) == 68);
DCD_ASSERT_(offsetof(DcdFluid, drag) == 80);
DCD_ASSERT_(offsetof(DcdFluid, damping) == 84);
DCD_ASSERT_(offsetof(DcdFluid, lift) == 88);
DCD_ASSERT_(offsetof(DcdFluid, reserved) == 92);
DCD_ASSERT_(sizeof(DcdShapeInfo) == 76);
DCD_ASSERT_(offsetof(DcdShapeInfo, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdShapeInfo, kind) == 4);
DCD_ASSERT_(offsetof(DcdShapeInfo, size) == 8);
DCD_ASSERT_(offsetof(DcdShapeInfo, border) == 20);
DCD_ASSERT_(offsetof(DcdShapeInfo, frame) == 24);
DCD_ASSERT_(offsetof(DcdShapeInfo, vertex_count) == 52);
DCD_ASSERT_(offsetof(DcdShapeInfo, triangle_count) == 56);
DCD_ASSERT_(offsetof(DcdShapeInfo, rows) == 60);
DCD_ASSERT_(offsetof(DcdShapeInfo, columns) == 64);
DCD_ASSERT_(offsetof(DcdShapeInfo, parts) == 68);
DCD_ASSERT_(offsetof(DcdShapeInfo, reserved) == 72);
DCD_ASSERT_(sizeof(DcdSettings) == 80);
DCD_ASSERT_(offsetof(DcdSettings, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdSettings, solver_iterations) == 4);
DCD_ASSERT_(offsetof(DcdSettings, gravity) == 8);
DCD_ASSERT_(offsetof(DcdSettings, dt) == 20);
DCD_ASSERT_(offsetof(DcdSettings, length_unit) == 24);
DCD_ASSERT_(offsetof(DcdSettings, speed_limit) == 28);
DCD_ASSERT_(offsetof(DcdSettings, contact_frequency) == 32);
DCD_ASSERT_(offsetof(DcdSettings, contact_damping) == 36);
DCD_ASSERT_(offsetof(DcdSettings, static_frequency) == 40);
DCD_ASSERT_(offsetof(DcdSettings, static_damping) == 44);
DCD_ASSERT_(offsetof(DcdSettings, max_correction) == 48);
DCD_ASSERT_(offsetof(DcdSettings, allowed_overlap) == 52);
DCD_ASSERT_(offsetof(DcdSettings, contact_margin) == 56);
DCD_ASSERT_(offsetof(DcdSettings, warm_start) == 60);
DCD_ASSERT_(offsetof(DcdSettings, internal_iterations) == 64);
DCD_ASSERT_(offsetof(DcdSettings, ccd_substeps) == 68);
DCD_ASSERT_(offsetof(DcdSettings, tolerance) == 72);
DCD_ASSERT_(offsetof(DcdSettings, friction_model) == 76);
DCD_ASSERT_(sizeof(DcdProfile) == 112);
DCD_ASSERT_(offsetof(DcdProfile, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdProfile, reserved) == 4);
DCD_ASSERT_(offsetof(DcdProfile, rapier) == 8);
DCD_ASSERT_(offsetof(DcdProfile, broad_phase) == 16);
DCD_ASSERT_(offsetof(DcdProfile, narrow_phase) == 24);
DCD_ASSERT_(offsetof(DcdProfile, islands) == 32);
DCD_ASSERT_(offsetof(DcdProfile, solver) == 40);
DCD_ASSERT_(offsetof(DcdProfile, ccd) == 48);
DCD_ASSERT_(offsetof(DcdProfile, border) == 56);
DCD_ASSERT_(offsetof(DcdProfile, contact_pairs) == 64);
DCD_ASSERT_(offsetof(DcdProfile, contacts) == 72);
DCD_ASSERT_(offsetof(DcdProfile, awake) == 80);
DCD_ASSERT_(offsetof(DcdProfile, joints) == 88);
DCD_ASSERT_(offsetof(DcdProfile, islands_awake) == 96);
DCD_ASSERT_(offsetof(DcdProfile, memory) == 104);
DCD_ASSERT_(sizeof(DcdViewpoint) == 32);
DCD_ASSERT_(offsetof(DcdViewpoint, at) == 0);
DCD_ASSERT_(offsetof(DcdViewpoint, radius) == 24);
DCD_ASSERT_(sizeof(DcdFidelityReport) == 56);
DCD_ASSERT_(offsetof(DcdFidelityReport, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdFidelityReport, error) == 4);
DCD_ASSERT_(offsetof(DcdFidelityReport, low95) == 8);
DCD_ASSERT_(offsetof(DcdFidelityReport, high95) == 12);
DCD_ASSERT_(offsetof(DcdFidelityReport, share_of_full_time) == 16);
DCD_ASSERT_(offsetof(DcdFidelityReport, audits) == 24);
DCD_ASSERT_(offsetof(DcdFidelityReport, overruns) == 32);
DCD_ASSERT_(offsetof(DcdFidelityReport, levels) == 40);
DCD_ASSERT_(offsetof(DcdFidelityReport, reserved) == 52);
DCD_ASSERT_(sizeof(DcdBodyExtent) == 96);
DCD_ASSERT_(offsetof(DcdBodyExtent, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdBodyExtent, mass) == 4);
DCD_ASSERT_(offsetof(DcdBodyExtent, min) == 8);
DCD_ASSERT_(offsetof(DcdBodyExtent, max) == 32);
DCD_ASSERT_(offsetof(DcdBodyExtent, centre) == 56);
DCD_ASSERT_(offsetof(DcdBodyExtent, inertia) == 68);
DCD_ASSERT_(offsetof(DcdBodyExtent, axes) == 80);
DCD_ASSERT_(sizeof(DcdJointDef) == 144);
DCD_ASSERT_(offsetof(DcdJointDef, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdJointDef, joint_type) == 4);
DCD_ASSERT_(offsetof(DcdJointDef, a) == 8);
DCD_ASSERT_(offsetof(DcdJointDef, b) == 16);
DCD_ASSERT_(offsetof(DcdJointDef, frame_a) == 24);
DCD_ASSERT_(offsetof(DcdJointDef, frame_b) == 52);
DCD_ASSERT_(offsetof(DcdJointDef, limit) == 80);
DCD_ASSERT_(offsetof(DcdJointDef, motor) == 88);
DCD_ASSERT_(offsetof(DcdJointDef, flags) == 112);
DCD_ASSERT_(offsetof(DcdJointDef, locked) == 116);
DCD_ASSERT_(offsetof(DcdJointDef, coupled) == 120);
DCD_ASSERT_(offsetof(DcdJointDef, natural_frequency) == 124);
DCD_ASSERT_(offsetof(DcdJointDef, damping_ratio) == 128);
DCD_ASSERT_(offsetof(DcdJointDef, reserved) == 132);
DCD_ASSERT_(offsetof(DcdJointDef, user_data) == 136);
DCD_ASSERT_(sizeof(DcdJointMotor) == 24);
DCD_ASSERT_(offsetof(DcdJointMotor, position) == 0);
DCD_ASSERT_(offsetof(DcdJointMotor, velocity) == 4);
DCD_ASSERT_(offsetof(DcdJointMotor, stiffness) == 8);
DCD_ASSERT_(offsetof(DcdJointMotor, damping) == 12);
DCD_ASSERT_(offsetof(DcdJointMotor, max_force) == 16);
DCD_ASSERT_(offsetof(DcdJointMotor, model) == 20);
DCD_ASSERT_(sizeof(DcdJointInfo) == 160);
DCD_ASSERT_(offsetof(DcdJointInfo, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdJointInfo, joint_type) == 4);
DCD_ASSERT_(offsetof(DcdJointInfo, a) == 8);
DCD_ASSERT_(offsetof(DcdJointInfo, b) == 16);
DCD_ASSERT_(offsetof(DcdJointInfo, user_data) == 24);
DCD_ASSERT_(offsetof(DcdJointInfo, frame_a) == 32);
DCD_ASSERT_(offsetof(DcdJointInfo, frame_b) == 60);
DCD_ASSERT_(offsetof(DcdJointInfo, offset) == 88);
DCD_ASSERT_(offsetof(DcdJointInfo, position) == 116);
DCD_ASSERT_(offsetof(DcdJointInfo, force) == 120);
DCD_ASSERT_(offsetof(DcdJointInfo, natural_frequency) == 132);
DCD_ASSERT_(offsetof(DcdJointInfo, damping_ratio) == 136);
DCD_ASSERT_(offsetof(DcdJointInfo, flags) == 140);
DCD_ASSERT_(offsetof(DcdJointInfo, locked) == 144);
DCD_ASSERT_(offsetof(DcdJointInfo, coupled) == 148);
DCD_ASSERT_(offsetof(DcdJointInfo, limited) == 152);
DCD_ASSERT_(offsetof(DcdJointInfo, driven) == 156);
DCD_ASSERT_(sizeof(DcdViewTime) == 48);
DCD_ASSERT_(offsetof(DcdViewTime, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdViewTime, reserved) == 4);
DCD_ASSERT_(offsetof(DcdViewTime, now) == 8);
DCD_ASSERT_(offsetof(DcdViewTime, shown) == 16);
DCD_ASSERT_(offsetof(DcdViewTime, predicted) == 24);
DCD_ASSERT_(offsetof(DcdViewTime, clock_error) == 32);
DCD_ASSERT_(offsetof(DcdViewTime, input_delay) == 40);
DCD_ASSERT_(sizeof(DcdDrawnShape) == 56);
DCD_ASSERT_(offsetof(DcdDrawnShape, kind) == 0);
DCD_ASSERT_(offsetof(DcdDrawnShape, mesh) == 4);
DCD_ASSERT_(offsetof(DcdDrawnShape, size) == 8);
DCD_ASSERT_(offsetof(DcdDrawnShape, reserved) == 20);
DCD_ASSERT_(offsetof(DcdDrawnShape, vertices) == 24);
DCD_ASSERT_(offsetof(DcdDrawnShape, vertex_count) == 32);
DCD_ASSERT_(offsetof(DcdDrawnShape, triangles) == 40);
DCD_ASSERT_(offsetof(DcdDrawnShape, triangle_count) == 48);
DCD_ASSERT_(sizeof(DcdDebugDraw) == 112);
DCD_ASSERT_(offsetof(DcdDebugDraw, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdDebugDraw, flags) == 4);
DCD_ASSERT_(offsetof(DcdDebugDraw, context) == 8);
DCD_ASSERT_(offsetof(DcdDebugDraw, draw_point) == 16);
DCD_ASSERT_(offsetof(DcdDebugDraw, draw_line) == 24);
DCD_ASSERT_(offsetof(DcdDebugDraw, draw_box) == 32);
DCD_ASSERT_(offsetof(DcdDebugDraw, draw_shape) == 40);
DCD_ASSERT_(offsetof(DcdDebugDraw, draw_text) == 48);
DCD_ASSERT_(offsetof(DcdDebugDraw, min) == 56);
DCD_ASSERT_(offsetof(DcdDebugDraw, max) == 80);
DCD_ASSERT_(offsetof(DcdDebugDraw, velocity_scale) == 104);
DCD_ASSERT_(offsetof(DcdDebugDraw, force_scale) == 108);
DCD_ASSERT_(sizeof(DcdPrediction) == 56);
DCD_ASSERT_(offsetof(DcdPrediction, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdPrediction, bodies) == 4);
DCD_ASSERT_(offsetof(DcdPrediction, ticks) == 8);
DCD_ASSERT_(offsetof(DcdPrediction, replays) == 16);
DCD_ASSERT_(offsetof(DcdPrediction, corrections) == 24);
DCD_ASSERT_(offsetof(DcdPrediction, largest_correction) == 32);
DCD_ASSERT_(offsetof(DcdPrediction, last_frame) == 40);
DCD_ASSERT_(offsetof(DcdPrediction, longest_frame) == 48);
DCD_ASSERT_(sizeof(DcdStateView) == 80);
DCD_ASSERT_(offsetof(DcdStateView, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdStateView, slot_count) == 4);
DCD_ASSERT_(offsetof(DcdStateView, tick) == 8);
DCD_ASSERT_(offsetof(DcdStateView, count) == 16);
DCD_ASSERT_(offsetof(DcdStateView, ids) == 24);
DCD_ASSERT_(offsetof(DcdStateView, poses) == 32);
DCD_ASSERT_(offsetof(DcdStateView, velocities) == 40);
DCD_ASSERT_(offsetof(DcdStateView, user_data) == 48);
DCD_ASSERT_(offsetof(DcdStateView, flags) == 56);
DCD_ASSERT_(offsetof(DcdStateView, regions) == 64);
DCD_ASSERT_(offsetof(DcdStateView, slots) == 72);
DCD_ASSERT_(sizeof(DcdConnectionEvent) == 288);
DCD_ASSERT_(offsetof(DcdConnectionEvent, connection) == 0);
DCD_ASSERT_(offsetof(DcdConnectionEvent, state) == 8);
DCD_ASSERT_(offsetof(DcdConnectionEvent, role) == 12);
DCD_ASSERT_(offsetof(DcdConnectionEvent, node) == 16);
DCD_ASSERT_(offsetof(DcdConnectionEvent, client) == 20);
DCD_ASSERT_(offsetof(DcdConnectionEvent, cause) == 24);
DCD_ASSERT_(offsetof(DcdConnectionEvent, reserved) == 28);
DCD_ASSERT_(offsetof(DcdConnectionEvent, reason) == 32);
DCD_ASSERT_(sizeof(DcdConnectionInfo) == 104);
DCD_ASSERT_(offsetof(DcdConnectionInfo, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdConnectionInfo, state) == 4);
DCD_ASSERT_(offsetof(DcdConnectionInfo, role) == 8);
DCD_ASSERT_(offsetof(DcdConnectionInfo, node) == 12);
DCD_ASSERT_(offsetof(DcdConnectionInfo, client) == 16);
DCD_ASSERT_(offsetof(DcdConnectionInfo, loss) == 20);
DCD_ASSERT_(offsetof(DcdConnectionInfo, rtt) == 24);
DCD_ASSERT_(offsetof(DcdConnectionInfo, age) == 32);
DCD_ASSERT_(offsetof(DcdConnectionInfo, bytes_in) == 40);
DCD_ASSERT_(offsetof(DcdConnectionInfo, bytes_out) == 48);
DCD_ASSERT_(offsetof(DcdConnectionInfo, udp_bytes_in) == 56);
DCD_ASSERT_(offsetof(DcdConnectionInfo, udp_bytes_out) == 64);
DCD_ASSERT_(offsetof(DcdConnectionInfo, messages_in) == 72);
DCD_ASSERT_(offsetof(DcdConnectionInfo, messages_out) == 80);
DCD_ASSERT_(offsetof(DcdConnectionInfo, dropped) == 88);
DCD_ASSERT_(offsetof(DcdConnectionInfo, bytes_waiting) == 96);
DCD_ASSERT_(sizeof(DcdMessage) == 40);
DCD_ASSERT_(offsetof(DcdMessage, connection) == 0);
DCD_ASSERT_(offsetof(DcdMessage, data) == 8);
DCD_ASSERT_(offsetof(DcdMessage, size) == 16);
DCD_ASSERT_(offsetof(DcdMessage, role) == 24);
DCD_ASSERT_(offsetof(DcdMessage, node) == 28);
DCD_ASSERT_(offsetof(DcdMessage, client) == 32);
DCD_ASSERT_(offsetof(DcdMessage, flags) == 36);
DCD_ASSERT_(sizeof(DcdContact) == 104);
DCD_ASSERT_(offsetof(DcdContact, a) == 0);
DCD_ASSERT_(offsetof(DcdContact, b) == 8);
DCD_ASSERT_(offsetof(DcdContact, user_a) == 16);
DCD_ASSERT_(offsetof(DcdContact, user_b) == 24);
DCD_ASSERT_(offsetof(DcdContact, point) == 32);
DCD_ASSERT_(offsetof(DcdContact, normal) == 56);
DCD_ASSERT_(offsetof(DcdContact, speed) == 68);
DCD_ASSERT_(offsetof(DcdContact, kind) == 72);
DCD_ASSERT_(offsetof(DcdContact, flags) == 76);
DCD_ASSERT_(offsetof(DcdContact, collider_a) == 80);
DCD_ASSERT_(offsetof(DcdContact, collider_b) == 84);
DCD_ASSERT_(offsetof(DcdContact, material_a) == 88);
DCD_ASSERT_(offsetof(DcdContact, material_b) == 96);
DCD_ASSERT_(sizeof(DcdContactPoint) == 88);
DCD_ASSERT_(offsetof(DcdContactPoint, a) == 0);
DCD_ASSERT_(offsetof(DcdContactPoint, b) == 8);
DCD_ASSERT_(offsetof(DcdContactPoint, point) == 16);
DCD_ASSERT_(offsetof(DcdContactPoint, normal) == 40);
DCD_ASSERT_(offsetof(DcdContactPoint, separation) == 52);
DCD_ASSERT_(offsetof(DcdContactPoint, impulse) == 56);
DCD_ASSERT_(offsetof(DcdContactPoint, manifold) == 60);
DCD_ASSERT_(offsetof(DcdContactPoint, collider_a) == 64);
DCD_ASSERT_(offsetof(DcdContactPoint, collider_b) == 68);
DCD_ASSERT_(offsetof(DcdContactPoint, material_a) == 72);
DCD_ASSERT_(offsetof(DcdContactPoint, material_b) == 80);
DCD_ASSERT_(sizeof(DcdContactForce) == 72);
DCD_ASSERT_(offsetof(DcdContactForce, a) == 0);
DCD_ASSERT_(offsetof(DcdContactForce, b) == 8);
DCD_ASSERT_(offsetof(DcdContactForce, user_a) == 16);
DCD_ASSERT_(offsetof(DcdContactForce, user_b) == 24);
DCD_ASSERT_(offsetof(DcdContactForce, force) == 32);
DCD_ASSERT_(offsetof(DcdContactForce, magnitude) == 44);
DCD_ASSERT_(offsetof(DcdContactForce, collider_a) == 48);
DCD_ASSERT_(offsetof(DcdContactForce, collider_b) == 52);
DCD_ASSERT_(offsetof(DcdContactForce, material_a) == 56);
DCD_ASSERT_(offsetof(DcdContactForce, material_b) == 64);
DCD_ASSERT_(sizeof(DcdJointOverload) == 24);
DCD_ASSERT_(offsetof(DcdJointOverload, joint) == 0);
DCD_ASSERT_(offsetof(DcdJointOverload, user_data) == 8);
DCD_ASSERT_(offsetof(DcdJointOverload, force) == 16);
DCD_ASSERT_(offsetof(DcdJointOverload, torque) == 20);
DCD_ASSERT_(sizeof(DcdHookedPair) == 184);
DCD_ASSERT_(offsetof(DcdHookedPair, a) == 0);
DCD_ASSERT_(offsetof(DcdHookedPair, b) == 8);
DCD_ASSERT_(offsetof(DcdHookedPair, user_a) == 16);
DCD_ASSERT_(offsetof(DcdHookedPair, user_b) == 24);
DCD_ASSERT_(offsetof(DcdHookedPair, material_a) == 32);
DCD_ASSERT_(offsetof(DcdHookedPair, material_b) == 40);
DCD_ASSERT_(offsetof(DcdHookedPair, collider_a) == 48);
DCD_ASSERT_(offsetof(DcdHookedPair, collider_b) == 52);
DCD_ASSERT_(offsetof(DcdHookedPair, pose_a) == 56);
DCD_ASSERT_(offsetof(DcdHookedPair, pose_b) == 96);
DCD_ASSERT_(offsetof(DcdHookedPair, velocity_a) == 136);
DCD_ASSERT_(offsetof(DcdHookedPair, velocity_b) == 160);
DCD_ASSERT_(sizeof(DcdHookedContact) == 48);
DCD_ASSERT_(offsetof(DcdHookedContact, normal) == 0);
DCD_ASSERT_(offsetof(DcdHookedContact, separation) == 12);
DCD_ASSERT_(offsetof(DcdHookedContact, points) == 16);
DCD_ASSERT_(offsetof(DcdHookedContact, enabled) == 20);
DCD_ASSERT_(offsetof(DcdHookedContact, friction) == 24);
DCD_ASSERT_(offsetof(DcdHookedContact, restitution) == 28);
DCD_ASSERT_(offsetof(DcdHookedContact, surface_velocity) == 32);
DCD_ASSERT_(offsetof(DcdHookedContact, memory) == 44);
DCD_ASSERT_(sizeof(DcdHooks) == 40);
DCD_ASSERT_(offsetof(DcdHooks, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdHooks, reserved) == 4);
DCD_ASSERT_(offsetof(DcdHooks, context) == 8);
DCD_ASSERT_(offsetof(DcdHooks, filter) == 16);
DCD_ASSERT_(offsetof(DcdHooks, detect) == 24);
DCD_ASSERT_(offsetof(DcdHooks, modify) == 32);
DCD_ASSERT_(sizeof(DcdTasks) == 32);
DCD_ASSERT_(offsetof(DcdTasks, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdTasks, reserved) == 4);
DCD_ASSERT_(offsetof(DcdTasks, context) == 8);
DCD_ASSERT_(offsetof(DcdTasks, enqueue) == 16);
DCD_ASSERT_(offsetof(DcdTasks, finish) == 24);
DCD_ASSERT_(sizeof(DcdTransfer) == 24);
DCD_ASSERT_(offsetof(DcdTransfer, body) == 0);
DCD_ASSERT_(offsetof(DcdTransfer, user_data) == 8);
DCD_ASSERT_(offsetof(DcdTransfer, from) == 16);
DCD_ASSERT_(offsetof(DcdTransfer, to) == 20);
DCD_ASSERT_(sizeof(DcdBodyChange) == 24);
DCD_ASSERT_(offsetof(DcdBodyChange, body) == 0);
DCD_ASSERT_(offsetof(DcdBodyChange, user_data) == 8);
DCD_ASSERT_(offsetof(DcdBodyChange, kind) == 16);
DCD_ASSERT_(offsetof(DcdBodyChange, reason) == 20);
DCD_ASSERT_(sizeof(DcdEventView) == 128);
DCD_ASSERT_(offsetof(DcdEventView, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdEventView, flags) == 4);
DCD_ASSERT_(offsetof(DcdEventView, tick) == 8);
DCD_ASSERT_(offsetof(DcdEventView, contacts) == 16);
DCD_ASSERT_(offsetof(DcdEventView, contact_count) == 24);
DCD_ASSERT_(offsetof(DcdEventView, forces) == 32);
DCD_ASSERT_(offsetof(DcdEventView, force_count) == 40);
DCD_ASSERT_(offsetof(DcdEventView, transfers) == 48);
DCD_ASSERT_(offsetof(DcdEventView, transfer_count) == 56);
DCD_ASSERT_(offsetof(DcdEventView, changes) == 64);
DCD_ASSERT_(offsetof(DcdEventView, change_count) == 72);
DCD_ASSERT_(offsetof(DcdEventView, connections) == 80);
DCD_ASSERT_(offsetof(DcdEventView, connection_count) == 88);
DCD_ASSERT_(offsetof(DcdEventView, messages) == 96);
DCD_ASSERT_(offsetof(DcdEventView, message_count) == 104);
DCD_ASSERT_(offsetof(DcdEventView, overloads) == 112);
DCD_ASSERT_(offsetof(DcdEventView, overload_count) == 120);
DCD_ASSERT_(sizeof(DcdFilter) == 32);
DCD_ASSERT_(offsetof(DcdFilter, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdFilter, flags) == 4);
DCD_ASSERT_(offsetof(DcdFilter, groups) == 8);
DCD_ASSERT_(offsetof(DcdFilter, mask) == 12);
DCD_ASSERT_(offsetof(DcdFilter, exclude) == 16);
DCD_ASSERT_(offsetof(DcdFilter, exclude_count) == 24);
DCD_ASSERT_(sizeof(DcdRay) == 56);
DCD_ASSERT_(offsetof(DcdRay, origin) == 0);
DCD_ASSERT_(offsetof(DcdRay, direction) == 24);
DCD_ASSERT_(offsetof(DcdRay, max_distance) == 36);
DCD_ASSERT_(offsetof(DcdRay, exclude) == 40);
DCD_ASSERT_(offsetof(DcdRay, mask) == 48);
DCD_ASSERT_(offsetof(DcdRay, flags) == 52);
DCD_ASSERT_(sizeof(DcdRayHit) == 72);
DCD_ASSERT_(offsetof(DcdRayHit, body) == 0);
DCD_ASSERT_(offsetof(DcdRayHit, user_data) == 8);
DCD_ASSERT_(offsetof(DcdRayHit, point) == 16);
DCD_ASSERT_(offsetof(DcdRayHit, normal) == 40);
DCD_ASSERT_(offsetof(DcdRayHit, distance) == 52);
DCD_ASSERT_(offsetof(DcdRayHit, collider) == 56);
DCD_ASSERT_(offsetof(DcdRayHit, subshape) == 60);
DCD_ASSERT_(offsetof(DcdRayHit, material) == 64);
DCD_ASSERT_(sizeof(DcdShapeCast) == 96);
DCD_ASSERT_(offsetof(DcdShapeCast, shape) == 0);
DCD_ASSERT_(offsetof(DcdShapeCast, pose) == 8);
DCD_ASSERT_(offsetof(DcdShapeCast, motion) == 48);
DCD_ASSERT_(offsetof(DcdShapeCast, turn) == 60);
DCD_ASSERT_(offsetof(DcdShapeCast, margin) == 72);
DCD_ASSERT_(offsetof(DcdShapeCast, mask) == 76);
DCD_ASSERT_(offsetof(DcdShapeCast, exclude) == 80);
DCD_ASSERT_(offsetof(DcdShapeCast, flags) == 88);
DCD_ASSERT_(offsetof(DcdShapeCast, reserved) == 92);
DCD_ASSERT_(sizeof(DcdShapeHit) == 104);
DCD_ASSERT_(offsetof(DcdShapeHit, body) == 0);
DCD_ASSERT_(offsetof(DcdShapeHit, user_data) == 8);
DCD_ASSERT_(offsetof(DcdShapeHit, point) == 16);
DCD_ASSERT_(offsetof(DcdShapeHit, normal) == 40);
DCD_ASSERT_(offsetof(DcdShapeHit, fraction) == 52);
DCD_ASSERT_(offsetof(DcdShapeHit, point_on_shape) == 56);
DCD_ASSERT_(offsetof(DcdShapeHit, normal_on_shape) == 68);
DCD_ASSERT_(offsetof(DcdShapeHit, collider) == 80);
DCD_ASSERT_(offsetof(DcdShapeHit, subshape) == 84);
DCD_ASSERT_(offsetof(DcdShapeHit, flags) == 88);
DCD_ASSERT_(offsetof(DcdShapeHit, reserved) == 92);
DCD_ASSERT_(offsetof(DcdShapeHit, material) == 96);
DCD_ASSERT_(sizeof(DcdPointQuery) == 48);
DCD_ASSERT_(offsetof(DcdPointQuery, point) == 0);
DCD_ASSERT_(offsetof(DcdPointQuery, max_distance) == 24);
DCD_ASSERT_(offsetof(DcdPointQuery, mask) == 28);
DCD_ASSERT_(offsetof(DcdPointQuery, exclude) == 32);
DCD_ASSERT_(offsetof(DcdPointQuery, flags) == 40);
DCD_ASSERT_(offsetof(DcdPointQuery, reserved) == 44);
DCD_ASSERT_(sizeof(DcdPointHit) == 64);
DCD_ASSERT_(offsetof(DcdPointHit, body) == 0);
DCD_ASSERT_(offsetof(DcdPointHit, user_data) == 8);
DCD_ASSERT_(offsetof(DcdPointHit, point) == 16);
DCD_ASSERT_(offsetof(DcdPointHit, distance) == 40);
DCD_ASSERT_(offsetof(DcdPointHit, collider) == 44);
DCD_ASSERT_(offsetof(DcdPointHit, flags) == 48);
DCD_ASSERT_(offsetof(DcdPointHit, reserved) == 52);
DCD_ASSERT_(offsetof(DcdPointHit, material) == 56);
DCD_ASSERT_(sizeof(DcdShapeQuery) == 64);
DCD_ASSERT_(offsetof(DcdShapeQuery, shape) == 0);
DCD_ASSERT_(offsetof(DcdShapeQuery, pose) == 8);
DCD_ASSERT_(offsetof(DcdShapeQuery, exclude) == 48);
DCD_ASSERT_(offsetof(DcdShapeQuery, mask) == 56);
DCD_ASSERT_(offsetof(DcdShapeQuery, reserved) == 60);
DCD_ASSERT_(sizeof(DcdBoxQuery) == 64);
DCD_ASSERT_(offsetof(DcdBoxQuery, min) == 0);
DCD_ASSERT_(offsetof(DcdBoxQuery, max) == 24);
DCD_ASSERT_(offsetof(DcdBoxQuery, exclude) == 48);
DCD_ASSERT_(offsetof(DcdBoxQuery, mask) == 56);
DCD_ASSERT_(offsetof(DcdBoxQuery, reserved) == 60);
DCD_ASSERT_(sizeof(DcdOverlap) == 32);
DCD_ASSERT_(offsetof(DcdOverlap, body) == 0);
DCD_ASSERT_(offsetof(DcdOverlap, user_data) == 8);
DCD_ASSERT_(offsetof(DcdOverlap, collider) == 16);
DCD_ASSERT_(offsetof(DcdOverlap, reserved) == 20);
DCD_ASSERT_(offsetof(DcdOverlap, material) == 24);
DCD_ASSERT_(sizeof(DcdCheckpointId) == 8);
DCD_ASSERT_(offsetof(DcdCheckpointId, v) == 0);
DCD_ASSERT_(sizeof(DcdQueryId) == 8);
DCD_ASSERT_(offsetof(DcdQueryId, v) == 0);
DCD_ASSERT_(sizeof(DcdRegionInfo) == 64);
DCD_ASSERT_(offsetof(DcdRegionInfo, region) == 0);
DCD_ASSERT_(offsetof(DcdRegionInfo, bodies) == 4);
DCD_ASSERT_(offsetof(DcdRegionInfo, ghosts) == 8);
DCD_ASSERT_(offsetof(DcdRegionInfo, node) == 12);
DCD_ASSERT_(offsetof(DcdRegionInfo, min) == 16);
DCD_ASSERT_(offsetof(DcdRegionInfo, max) == 40);
DCD_ASSERT_(sizeof(DcdOwner) == 20);
DCD_ASSERT_(offsetof(DcdOwner, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdOwner, region) == 4);
DCD_ASSERT_(offsetof(DcdOwner, node) == 8);
DCD_ASSERT_(offsetof(DcdOwner, holders) == 12);
DCD_ASSERT_(offsetof(DcdOwner, flags) == 16);
DCD_ASSERT_(sizeof(DcdBorderInfo) == 24);
DCD_ASSERT_(offsetof(DcdBorderInfo, a) == 0);
DCD_ASSERT_(offsetof(DcdBorderInfo, b) == 4);
DCD_ASSERT_(offsetof(DcdBorderInfo, bodies) == 8);
DCD_ASSERT_(offsetof(DcdBorderInfo, exchanges) == 12);
DCD_ASSERT_(offsetof(DcdBorderInfo, depth) == 16);
DCD_ASSERT_(offsetof(DcdBorderInfo, disagreement) == 20);
DCD_ASSERT_(sizeof(DcdStats) == 112);
DCD_ASSERT_(offsetof(DcdStats, struct_size) == 0);
DCD_ASSERT_(offsetof(DcdStats, regions) == 4);
DCD_ASSERT_(offsetof(DcdStats, ticks) == 8);
DCD_ASSERT_(offsetof(DcdStats, bodies) == 16);
DCD_ASSERT_(offsetof(DcdStats, ghosts) == 24);
DCD_ASSERT_(offsetof(DcdStats, transfers) == 32);
DCD_ASSERT_(offsetof(DcdStats, quarantined) == 40);
DCD_ASSERT_(offsetof(DcdStats, updates) == 48);
DCD_ASSERT_(offsetof(DcdStats, bytes_in) == 56);
DCD_ASSERT_(offsetof(DcdStats, bytes_out) == 64);
DCD_ASSERT_(offsetof(DcdStats, udp_bytes_in) == 72);
DCD_ASSERT_(offsetof(DcdStats, udp_bytes_out) == 80);
DCD_ASSERT_(offsetof(DcdStats, rtt) == 88);
DCD_ASSERT_(offsetof(DcdStats, last_step) == 96);
DCD_ASSERT_(offsetof(DcdStats, disagreement) == 104);
DCD_ASSERT_(offsetof(DcdStats, exchanges) == 108);
#undef DCD_ASSERT_
#endif

#endif /* DCD_H */
