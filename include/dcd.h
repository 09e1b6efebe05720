/* dcd: one rigid-body world, computed by many Rapier worlds.
 *
 * Calls. Every function returns a DcdStatus, DCD_OK or a negative code, and writes its outputs only on success; the few
 * others say so. dcd_last_error() gives the message of the calling thread's last failure: function, cause, remedy.
 *
 * Handles. Worlds, bodies, shapes, joints and connections are opaque numbers in a struct; { 0 } is null. A handle whose thing is
 * gone, or that belongs to another world, gives DCD_ERR_STALE_ID, for ever; a null one gives DCD_ERR_NULL.
 *
 * Roles. A world is local, a client's, a builder's, a participant's, a server's or a node's, and its functions are the same. What a role cannot
 * do is DCD_ERR_UNSUPPORTED; the message says what to use instead. "Who can do what" in examples-c/README.md is a table of it.
 *
 * Structs. Those that begin with struct_size may grow in later versions. Start from their _INIT macro:
 *
 *     DcdBodyDef def = DCD_BODY_DEF_INIT;
 *
 * Members named reserved are 0. Values outside their range are DCD_ERR_ARGUMENT.
 *
 * Pointers. What a function reads is read during the call; it keeps none of your pointers (but those of dcd_log_set,
 * dcd_bug_set, dcd_hooks_set, dcd_tasks_set and dcd_allocator_set). They must be aligned for their type. What it lends says how long it lives. Texts are UTF-8 that ends with NUL.
 *
 * Threads. Any thread may call any function at any time. Calls on one world run one after the other; a call waits for its
 * turn, but queries (dcd_cast_rays, dcd_overlap_shapes and the like) and what only reads (dcd_body_get, dcd_state_read, dcd_stats and the like)
 * run beside each other. Calls on different worlds run side by side. From within a function
 * that the library calls (those of dcd_log_set, dcd_bug_set, dcd_debug_draw, dcd_hooks_set, dcd_tasks_set, queries) every call on a world is DCD_ERR_BUSY.
 *
 * Bugs of ours. A panic inside the library becomes DCD_ERR_PANIC, and dcd_bug_set tells where. The world it happened in answers every later call so, and
 * can be destroyed; everything else goes on.
 *
 * Units. Metres, kilograms, seconds, newtons, radians. Positions in world space are double, all else is float. Vectors are
 * x, y, z; y is up by default. Quaternions are x, y, z, w.
 */
#ifndef DCD_H
#define DCD_H


/* Generated from dcd-ffi by cbindgen; write it anew with: UPDATE=1 cargo test -p dcd-ffi --test header */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* DCD_SHARED: define it on Windows when linking to the shared library. */
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

// Most items of one bulk call.
#define DCD_MAX_ITEMS 16777216

// Every number given as a float lies within plus and minus this, where its function does not say otherwise: what is beyond
// would not stay finite in single precision.
#define DCD_MAX_NUMBER 1.0e6

// Every coordinate in world space lies within plus and minus this, metres.
#define DCD_MAX_COORDINATE 1.0e9

// In DcdBodyDef.flags: never jumps through moving bodies either, at some cost. Through fixed ones no body does.
#define DCD_BODY_CCD 1

// In DcdBodyDef.flags: detects and does not push.
#define DCD_BODY_SENSOR 2

// In DcdBodyDef.flags: does not fall asleep by itself.
#define DCD_BODY_NO_SLEEP 4

// In DcdBodyDef.flags: sleeps until something wakes it.
#define DCD_BODY_ASLEEP 8

// In DcdBodyDef.flags: is not there until dcd_body_set_properties takes this away; it keeps its place, its joints wait.
#define DCD_BODY_DISABLED 16

// In DcdBodyDef.flags: may turn by more than a quarter turn per step, as wheels and propellers.
#define DCD_BODY_FAST_SPIN 32

// In DcdBodyDef.flags: its spin is not changed by its own inertia, as that of a thrown book is.
#define DCD_BODY_NO_GYRO 64

// In DcdBodyDef.flags: one match of groups and mask is enough for two bodies that both say so; else both must match.
#define DCD_BODY_ANY_GROUP 128

// In DcdBodyDef.events: dcd_events tells of contacts that begin and end.
#define DCD_EVENT_CONTACT 1

// In DcdBodyDef.events: dcd_events tells of contacts that press harder than force_threshold.
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

// As DcdBodyInfo.region of a fixed body, which has no owner.
#define DCD_NO_REGION UINT32_MAX

// In DcdWorldDef.axes: planes across x may cut the world into regions.
#define DCD_CUT_X 1

// Planes across y.
#define DCD_CUT_Y 2

// Planes across z.
#define DCD_CUT_Z 4

// In DcdServerDef.flags: begin anew, and forget a world that the data folder holds.
#define DCD_SERVER_FRESH 1

// In DcdServerDef.flags: as fast as the nodes can, rather than in real time.
#define DCD_SERVER_UNPACED 2

// Least size of a shape, metres: what is smaller has no mass to speak of in single precision.
#define DCD_MIN_SIZE 1.0e-4

// Names all colliders of a body, in place of a collider's number.
#define DCD_ALL_COLLIDERS UINT32_MAX

// The most colliders of one body.
#define DCD_MAX_COLLIDERS 4096

// In DcdBodyDef.pairs: it meets dynamic bodies if it is dynamic.
#define DCD_PAIR_DYNAMIC_DYNAMIC 1

// In DcdBodyDef.pairs: kinematic if dynamic, and the other way round.
#define DCD_PAIR_DYNAMIC_KINEMATIC 2

// In DcdBodyDef.pairs: fixed if dynamic, and the other way round.
#define DCD_PAIR_DYNAMIC_FIXED 4

// In DcdBodyDef.pairs: kinematic if kinematic.
#define DCD_PAIR_KINEMATIC_KINEMATIC 8

// In DcdBodyDef.pairs: fixed if kinematic, and the other way round, as a fixed sensor that notices doors and players.
#define DCD_PAIR_KINEMATIC_FIXED 16

// In DcdBodyDef.pairs: fixed if fixed.
#define DCD_PAIR_FIXED_FIXED 32

// In DcdColliderProperties.flags: detects and does not push.
#define DCD_COLLIDER_SENSOR 1

// In DcdColliderProperties.flags: is not there until this is taken away.
#define DCD_COLLIDER_DISABLED 2

// In DcdColliderProperties.flags: one match of groups and mask is enough for two colliders that both say so; else both must match.
#define DCD_COLLIDER_ANY_GROUP 4

// In DcdJointDef.flags: `limit` counts. In DcdJointInfo.flags: it has some limit.
#define DCD_JOINT_LIMIT 1

// In DcdJointDef.flags: `motor` runs. In DcdJointInfo.flags: it has some motor.
#define DCD_JOINT_MOTOR 2

// In DcdJointDef.flags: the two bodies collide with one another too.
#define DCD_JOINT_COLLIDE 4

// In DcdJointDef.flags: it does nothing until dcd_joint_set_flags takes this away.
#define DCD_JOINT_DISABLED 8

// As dcd_step_wait's timeout: until the step is done, however long it takes.
#define DCD_FOREVER UINT64_MAX

// In DcdStateView.flags: the body sleeps.
#define DCD_STATE_SLEEPING 1

// In DcdStateView.flags: your interest does not reach the body (dcd_interest_set); the state is that last heard of.
#define DCD_STATE_OUTSIDE 2

// Bytes of a reason at most, NUL included.
#define DCD_MAX_REASON 256

// In dcd_send's flags and DcdMessage.flags: a datagram, which may be lost or overtaken.
#define DCD_SEND_UNRELIABLE 1

// Bytes of a message at most.
#define DCD_MAX_MESSAGE 32768

// Bytes of one with DCD_SEND_UNRELIABLE at most.
#define DCD_MAX_DATAGRAM 1024

// In DcdContact.kind: two bodies began to touch.
#define DCD_CONTACT_BEGAN 0

// In DcdContact.kind: they ceased to.
#define DCD_CONTACT_ENDED 1

// In DcdContact.flags: one of them is a sensor.
#define DCD_CONTACT_SENSOR 1

// In DcdBodyChange.kind: a body of a served world came into it.
#define DCD_BODY_APPEARED 1

// In DcdBodyChange.kind: a body of a served world is gone; its id is stale.
#define DCD_BODY_REMOVED 2

// In DcdBodyChange.kind: what was asked of an avatar, or built, is refused. If it had not appeared yet it never will, and its id is
// stale.
#define DCD_BODY_REFUSED 3

// In DcdBodyChange.reason: the program speaks another version of the protocol than the server.
#define DCD_REFUSED_VERSION 1

// In DcdBodyChange.reason: the body is not an avatar of this process.
#define DCD_REFUSED_NOT_YOURS 2

// In DcdBodyChange.reason: the avatar is not in the world.
#define DCD_REFUSED_UNKNOWN 3

// In DcdBodyChange.reason: an avatar with this id is waiting for its return; make another.
#define DCD_REFUSED_EXISTS 4

// In DcdBodyChange.reason: the velocity is above the limit that the server sets, or the spin above a quarter of a turn per tick.
#define DCD_REFUSED_TOO_FAST 5

// In DcdBodyChange.reason: a newer input had arrived before.
#define DCD_REFUSED_LATE 6

// In DcdBodyChange.reason: the shape did not arrive with the avatar, or cannot be an avatar's; or a builder's, which has neither voxels nor
// half-spaces.
#define DCD_REFUSED_SHAPE 7

// In DcdBodyChange.reason: too many avatars, too much asked of them at a time, or more than 1 MiB of new shapes that are not
// forgotten yet: use the shapes that you have. Of a builder: more than 4,096 bodies or joints of its own, 24,576 changes at once and 1,024 more
// each second, or 16 MiB of such shapes.
#define DCD_REFUSED_TOO_MANY 8

// In DcdBodyChange.reason: the avatar would cost too much: it has more than 8 extra solver or PGS iterations, reaches farther than 100 m
// from its origin, begins where 64 others of this client are, or all of them together have more than 20,000 corners (200,000,
// and 16,384 colliders, of what a builder has built); or a body that is built takes more than 60 KiB with its shapes and what joints tie to
// it, or asks for contacts of fixed bodies; of a client's characters and vehicles see dcd_character_create and dcd_vehicle_create; what is built begins among 1,024 colliders at most and looks 10 m around (contact_skin, soft_ccd).
#define DCD_REFUSED_COSTLY 9

// In DcdBodyChange.reason: the jump is farther than the avatar could have moved since its last one, or in a second, at the limit of
// speed that the server sets.
#define DCD_REFUSED_TOO_FAR 10

// In DcdBodyChange.reason: the client may not build: its token was for another role than DCD_ROLE_BUILDER.
#define DCD_REFUSED_MAY_NOT_BUILD 11

// In DcdBodyChange.reason: a builder may not do that: it leaves avatars, the kind of fixed bodies, and shapes as they are.
#define DCD_REFUSED_NOT_TO_BE_BUILT 12

// In DcdEventView.flags: the link to the server is gone; dcd_step says why.
#define DCD_EVENTS_LOST 1

// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.filter is asked about contacts of the collider.
#define DCD_HOOK_FILTER 1

// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.detect is asked about what it detects as a sensor, or is detected by.
#define DCD_HOOK_DETECT 2

// In DcdBodyDef.hooks and DcdColliderProperties.hooks: DcdHooks.modify is asked about its contacts before they are solved.
#define DCD_HOOK_MODIFY 4

// In DcdFilter.flags: overlooks fixed bodies.
#define DCD_FILTER_NO_FIXED 1

// In DcdFilter.flags: overlooks kinematic bodies.
#define DCD_FILTER_NO_KINEMATIC 2

// In DcdFilter.flags: overlooks dynamic bodies.
#define DCD_FILTER_NO_DYNAMIC 4

// In DcdFilter.flags: overlooks sensors.
#define DCD_FILTER_NO_SENSORS 8

// In DcdFilter.flags: overlooks all but sensors.
#define DCD_FILTER_NO_SOLIDS 16

// In flags of a ray or a point: bodies are hollow. A ray that starts inside of one meets its surface from within, and the
// place nearest to a point inside of one is on its surface.
#define DCD_QUERY_HOLLOW 1

// In DcdShapeCast.flags: what the shape overlaps at the start stops it only if it moves farther in.
#define DCD_QUERY_LEAVE 2

// In flags of a hit: it began there. The shape overlaps the body at the start, the point lies inside of it.
#define DCD_HIT_INSIDE 1

// The most that one submission may cost, and the most bodies of its filter. A ray costs 1, a shape that is cast or overlaps
// DCD_SHAPE_COST, a point or a box 1; overlaps that are submitted together cost DCD_OVERLAPS_COST at least.
#define DCD_MAX_SUBMITTED_COST 1024

// The cost of a submitted shape.
#define DCD_SHAPE_COST 8

// The least cost of overlaps that are submitted together.
#define DCD_OVERLAPS_COST 64

// The most queries that a world may have open: submitted, and neither fetched nor cancelled.
#define DCD_MAX_OPEN_QUERIES 64

// The most that all open queries of a world may cost.
#define DCD_MAX_OPEN_COST 4096

// The most that the overlaps of one submission may find.
#define DCD_MAX_SUBMITTED_OVERLAPS 4096

// The longest turn of a submitted cast, radians.
#define DCD_MAX_SUBMITTED_TURN 64.0

// The largest size of a shape that a submitted cast turns, and the farthest point of it from its origin, metres.
#define DCD_MAX_TURNING_SIZE 100.0

// As the node of a region or an owner where there is none.
#define DCD_NO_NODE UINT32_MAX

// In DcdOwner.flags: this process computes the region that owns the body.
#define DCD_OWNER_HERE 1

// In DcdOwner.flags: nobody has told yet who owns the body, which may not have moved since this process joined. The region is
// the one that it is in: its owner but for moments at borders, and while islands or joints tie it to one in another.
#define DCD_OWNER_BY_PLACE 4

// In DcdOwner.flags: what this world shows of the body was heard from others, and is some milliseconds old.
#define DCD_OWNER_HEARD 2

// The result of a call: DCD_OK, or one of the negative DCD_ERR_ codes. A code never changes its number.
typedef int32_t DcdStatus;

// The severity of a log line; DCD_LOG_OFF to DCD_LOG_TRACE.
typedef uint32_t DcdLogLevel;

// Receives log lines: `user` as given, the level, `length` bytes of UTF-8 that end without NUL and are valid during the
// call. Any thread may call it, several at a time. It must return normally (no longjmp, no C++ exception), and calls on
// worlds from within it give DCD_ERR_BUSY.
typedef void (*DcdLogFn)(void *user, DcdLogLevel level, const char *message, size_t length);

// Told of a bug: what does not hold, and where in the library's source. The texts are valid during the call.
typedef void (*DcdBugFn)(void *context, const char *message, const char *file, uint32_t line);

// Returns `size` bytes, above 0, aligned to `alignment`, a power of two; null if there are none, which ends the process.
typedef void *(*DcdAllocateFn)(void *context, size_t size, size_t alignment);

// Frees what DcdAllocateFn returned for this size and alignment.
typedef void (*DcdFreeFn)(void *context, void *block, size_t size, size_t alignment);

// The coupling: how regions come to consensus on the bodies that they share.
typedef uint32_t DcdCoupling;

// The accuracy that DCD_COUPLING_AUTO is asked for.
typedef uint32_t DcdPreset;

// How much of a world is computed in full: regions that nobody looks at may be stepped once per two or four steps.
typedef uint32_t DcdFidelity;

// The definition of a local world. Start from DCD_WORLD_DEF_INIT.
//
// How a world is cut. `regions` of them are made by halving: of the box from `min` to `max` the largest part is halved across its
// longest edge, until there are enough. Across that along which gravity pulls most it is not, unless nothing else is left to halve: a level
// cut goes through all that lies on the ground. `axes` says otherwise. dcd_regions lists what came of it. Cuts near which nothing lies cost
// nothing, so place the box around what moves.
typedef struct DcdWorldDef {
    // sizeof(DcdWorldDef).
    uint32_t struct_size;
    // Threads that compute the world, in as many regions as it has, 1 to 1024; 0 is one per core. 1 computes in the thread
    // that calls dcd_step, which does for few awake bodies anyhow. The result does not depend on it.
    uint32_t threads;
    // Regions that the world is cut into, 1 to 256; 0 is as many as the scene asks for, else 1, which is exact and has all
    // threads; more only where the bodies of a scene lie too far apart for the f32 of one region.
    uint32_t regions;
    // Iterations of the solver per step, 1 to 1000. More makes tall stacks stiffer and costs time.
    uint32_t solver_iterations;
    // m/s².
    float gravity[3];
    // Length of a step in seconds, above 0. It belongs to the world: all processes of a cluster share it.
    float dt;
    // Lowest corner of the box that is cut into regions, metres. Bodies may leave it: outer regions reach to infinity.
    double min[3];
    // Highest corner, above the lowest along each axis.
    double max[3];
    // Your own; dcd_world_info gives it back.
    uint64_t user_data;
    // DCD_COUPLING_...: how regions come to consensus. It says nothing in a world of one region.
    DcdCoupling coupling;
    // DCD_PRESET_...: what stands for DCD_COUPLING_AUTO and the four numbers below; with another coupling it must be 0.
    DcdPreset preset;
    // Exchanges between regions per step, 1 to 64; with DCD_COUPLING_AUTO the most that a border may take. 0 is what suits
    // the coupling, as in the next three.
    uint32_t exchanges;
    // Contact hops across a border within which bodies live in both regions, 1 to 16.
    uint32_t depth;
    // The most bodies of a group that moves whole to one region, to 65534.
    uint32_t island_limit;
    // The disagreement of copies that DCD_COUPLING_AUTO tolerates, m/s, above 0.
    float tolerance;
    // DCD_CUT_... bits: the axes across which `regions` are cut; 0 is all but that of gravity. With `regions` 0 it must be 0.
    uint32_t axes;
    // The fastest that a dynamic body moves, m/s, up to DCD_MAX_NUMBER; 0 is what the scene says, else 400. What forces and contacts make
    // faster is cut to it; a body that is made or set to be faster is refused. dcd_settings_set changes it.
    float speed_limit;
    // DCD_FIDELITY_...: how much of the world is computed in full; dcd_viewpoints_set says where it is looked at from. It goes with the
    // couplings that share mass: not with DCD_COUPLING_OWNER and _PROXY.
    DcdFidelity fidelity;
    // With DCD_FIDELITY_TOLERANCE m/s, with DCD_FIDELITY_BUDGET milliseconds, above 0; else 0.
    float fidelity_limit;
} DcdWorldDef;

// A world, whatever its role. 0 is null.
typedef struct DcdWorld {
    // Opaque.
    uint64_t v;
} DcdWorld;

// The role of a process in a world.
typedef uint32_t DcdRole;

// The role, tick and settings of a world. Start from DCD_WORLD_INFO_INIT.
typedef struct DcdWorldInfo {
    // sizeof(DcdWorldInfo).
    uint32_t struct_size;
    // DCD_ROLE_LOCAL, _CLIENT, _BUILDER, _PARTICIPANT, _SERVER or _NODE.
    DcdRole role;
    // Steps since the world began. In a served world the newest heard of: it lags by some milliseconds while bodies move, and
    // comes every 30 steps, then every 5 s while all rest (dcd_view_time tells the tick meanwhile); at the server every 30, and by up to 12 steps more.
    uint64_t tick;
    // Your own.
    uint64_t user_data;
    // Regions the world is cut into; those that this process computes, for a node.
    uint32_t regions;
    // Length of a step, seconds; 0 for a node, which takes it from its server, as gravity.
    float dt;
    // m/s².
    float gravity[3];
    // The number that the server knows this client, builder or participant by, from 1; 0 for all others.
    uint32_t client;
    // The fastest that a dynamic body moves, m/s, as dcd_settings_set left it; 0 for a node.
    float speed_limit;
    // 0.
    uint32_t reserved;
} DcdWorldInfo;

// The definition of a client that joins a served world. Start from DCD_CLIENT_DEF_INIT and give at least server and token.
typedef struct DcdClientDef {
    // sizeof(DcdClientDef).
    uint32_t struct_size;
    // Milliseconds to wait for the server and the world; 0 is 10,000.
    uint32_t timeout_ms;
    // Where the server is: "host:port", "192.0.2.1:port" or "[2001:db8::1]:port". Where servers stand by for one another
    // (`dcd serve --directory`) those of all, separated by commas without spaces: the one that answers is the server, now and later on.
    const char *server;
    // What `dcd token --role client` (or `builder`) or dcd_token_create gave; joining uses it up.
    const char *token;
    // A file that keeps who you are, or null. It is written on joining; who joins with it again gets the avatars back that
    // were left behind. It holds a secret.
    const char *identity_path;
    // Your own; dcd_world_info gives it back.
    uint64_t user_data;
    // The centre of the area of interest to begin with, metres of world space.
    double interest_centre[3];
    // Its radius, metres. You are told the bodies in it, the scenery that reaches into it, and the shapes and joints of those; later what
    // comes there, or where dcd_interest_set moves it to, appears (DCD_BODY_APPEARED). 0: you are told the whole world, whatever
    // your interest is later on.
    double interest_radius;
    // Milliseconds that the server may be out of reach later on, before dcd_step gives up; 0 is 30,000.
    uint32_t give_up_ms;
    // 0.
    uint32_t reserved;
} DcdClientDef;

// The definition of a participant that joins a served world. Start from DCD_PARTICIPANT_DEF_INIT and give at least server and token.
typedef struct DcdParticipantDef {
    // sizeof(DcdParticipantDef).
    uint32_t struct_size;
    // As in DcdClientDef.
    uint32_t timeout_ms;
    // As in DcdClientDef.
    const char *server;
    // What `dcd token --role participant` or dcd_token_create gave; joining uses it up.
    const char *token;
    // As in DcdClientDef.
    const char *identity_path;
    // Your own; dcd_world_info gives it back.
    uint64_t user_data;
    // Threads that compute its share, 1 to 1024; 0 is one per core.
    uint32_t threads;
    // As in DcdClientDef.
    uint32_t give_up_ms;
    // As in DcdClientDef.
    double interest_centre[3];
    // As in DcdClientDef.
    double interest_radius;
    // A file to record to all that its share of the world is given, and a digest of each region after each tick, for `dcd replay`; or
    // null.
    const char *record_path;
    // As in DcdServerDef, of the participant's node.
    const char *metrics;
} DcdParticipantDef;

// A body. 0 is null. An id is not given again, so that of a destroyed body stays stale for ever, unless dcd_checkpoint_restore
// goes back to before it was given, and but for avatars: a client that leaves and joins again with its identity file numbers new ones from those on
// that are left of its last stay, so that one may get the id of one that was destroyed. Forget ids at DCD_BODY_REMOVED. So may what a
// builder makes after its server was started again. An id of another world is stale in this one. A body has one id for as long as the world's
// handle lives, whoever owns it; other processes, and later handles of the same world, know it by other ids.
typedef struct DcdBodyId {
    // Opaque.
    uint64_t v;
} DcdBodyId;

// The settings by which nodes form groups and keep in step. Start from DCD_GROUP_DEF_INIT.
typedef struct DcdGroupDef {
    // sizeof(DcdGroupDef).
    uint32_t struct_size;
    // Nodes run ahead of one another by at most so many ticks, and extrapolate, 0 to 60; 0: lockstep. Else the
    // coupling must be DCD_COUPLING_OWNER.
    uint32_t lag_ticks;
    // Nodes share a group whose round trips are below this, milliseconds; 0: all that reach each other share one.
    float near_ms;
    // Members above this round trip are voted out of their group, milliseconds; above near_ms, and 0 where that is 0.
    float far_ms;
    // How far a body may be from its place in the group that is authoritative for it, metres, above 0.
    float agree;
    // Nodes in a group at most, 1 to 1024.
    uint32_t size;
} DcdGroupDef;

// The definition of a server. Start from DCD_SERVER_DEF_INIT and give at least `data_path` and one of `scene` and `source`.
typedef struct DcdServerDef {
    // sizeof(DcdServerDef).
    uint32_t struct_size;
    // Nodes to wait for before the first tick, 1 to 1024.
    uint32_t nodes;
    // A scene of the library, or the path of a scene file, as in dcd_world_open_scene; null with `source`.
    const char *scene;
    // Texts "name=value" that change parameters of the scene, or null.
    const char *const *params;
    // How many.
    size_t param_count;
    // How the world is cut and coupled, or null; what counts of it is what counts in dcd_world_open_scene.
    const DcdWorldDef *world;
    // A local world to serve as it is now, with its cut and settings; else null (v is 0). It is copied and stays yours. Bodies
    // keep their user data, and have other handles in the worlds that join. `scene`, `params` and `world` are null then.
    DcdWorld source;
    // How nodes form groups, or null for DCD_GROUP_DEF_INIT.
    const DcdGroupDef *groups;
    // Where to listen, as "127.0.0.1:7420", "0.0.0.0:7420" or "[::]:7420"; port 0 takes any free one (dcd_address).
    const char *listen;
    // A folder, made if need be, that keeps the server's keys, which tokens were used, and the world: a server that died
    // goes on with it when one is made in the same way. One server a folder.
    const char *data_path;
    // Ends the world after this tick; 0: when it is destroyed.
    uint64_t last_tick;
    // The fastest that clients may move their avatars, m/s, above 0 and up to 100,000.
    float avatar_speed;
    // DCD_SERVER_... bits.
    uint32_t flags;
    // Your own; dcd_world_info gives it back.
    uint64_t user_data;
    // Steps from one state of a moving body that clients are told to the next, 1 to 30: they show the steps between by interpolation
    // (dcd_view_time). 1 tells each step, in up to three times the bytes of 3.
    uint32_t state_every;
    // The share of participants, 0 to 1, whose regions the node that leads computes once more, to compare: one that computes otherwise is sent
    // away. Who is drawn is not told. Needs a node that is no participant, with as many more regions to compute, and lockstep. 0: none.
    float verify;
    // Where the server answers over HTTP with its metrics (/metrics, in Prometheus' text format) and whether it is well (/healthz, /readyz), as
    // "127.0.0.1:9420"; port 0 takes any free one (dcd_metrics_address). Whoever reaches it may read that. Null: nowhere, and nothing is measured.
    const char *metrics;
    // Keeps the world in etcd instead of in the folder: "etcd://HOST:PORT[,HOST:PORT...]/NAME", in a library that is built with its feature etcd.
    // Servers with the same one, scene and settings stand by for one another: dcd_server_create waits until none of the others serves. Over TLS it is
    // "etcds://HOST:PORT/NAME?cacert=FILE", with "&cert=FILE&key=FILE" where etcd asks for certificates, and "&user=NAME&password-file=FILE" where it has
    // users; without a file the password is in the environment (`DCD_ETCD_PASSWORD`). Null: in the folder.
    const char *directory;
    // A file to record to all that the server is given, for `dcd replay`; or null. One that holds something is refused: it may say what went wrong before.
    const char *record_path;
    // Seconds that the avatars of a client which left wait for its return (DcdClientDef.identity_path) before they are removed, above 0 and up to
    // 31,536,000.
    float avatar_expiry;
    // 0.
    uint32_t reserved;
} DcdServerDef;

// The definition of a node that joins a served world. Start from DCD_NODE_DEF_INIT and give at least server and token.
typedef struct DcdNodeDef {
    // sizeof(DcdNodeDef).
    uint32_t struct_size;
    // As in DcdClientDef.
    uint32_t timeout_ms;
    // As in DcdClientDef.
    const char *server;
    // What dcd_token_create or `dcd token --role node` gave; joining uses it up. A used one does where identity_path has its file already.
    const char *token;
    // As in DcdClientDef.
    const char *identity_path;
    // Where other nodes reach this one, as "192.0.2.7:7421", or null: any free port of the interface towards the server.
    const char *listen;
    // Your own; dcd_world_info gives it back.
    uint64_t user_data;
    // Threads that compute its share, 1 to 1024; 0 is one per core.
    uint32_t threads;
    // Milliseconds that the server may be out of reach later on, before the node gives up; 0: it waits without end, and computes on.
    uint32_t give_up_ms;
    // A file to record to all that the node is given, and a digest of each region after each tick, for `dcd replay`; or null. As in DcdServerDef.
    const char *record_path;
    // As in DcdServerDef, of the node.
    const char *metrics;
    // The address to give to other nodes and clients, where it is not the one listened on, as behind a NAT; or null.
    const char *advertise;
} DcdNodeDef;

// A shape of one world. 0 is null.
typedef struct DcdShapeId {
    // Opaque.
    uint64_t v;
} DcdShapeId;

// A pose relative to a body or a shape: position and rotation.
typedef struct DcdFrame {
    // Metres.
    float p[3];
    // Unit quaternion x, y, z, w (to 0.001).
    float q[4];
} DcdFrame;

// The type of a body: how it moves.
typedef uint32_t DcdBodyType;

// A pose in world space: position and rotation.
typedef struct DcdPose {
    // Position of the body's origin, metres.
    double p[3];
    // Unit quaternion x, y, z, w (to 0.001).
    float q[4];
} DcdPose;

// The velocity of a body, in world axes.
typedef struct DcdVelocity {
    // Of the centre of mass, m/s.
    float linear[3];
    // rad/s.
    float angular[3];
} DcdVelocity;

// The rule by which the coefficients of two colliders in contact become one; of two rules the one with the higher number counts.
typedef uint32_t DcdCombineRule;

// The definition of a body. Start from DCD_BODY_DEF_INIT and give at least `shape`. dcd_body_set_properties and
// dcd_collider_set_properties change it later.
typedef struct DcdBodyDef {
    // sizeof(DcdBodyDef).
    uint32_t struct_size;
    // DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    DcdBodyType body_type;
    // Where it starts.
    DcdPose pose;
    // How it moves at first.
    DcdVelocity velocity;
    // Of the same world. Two bodies may share one. dcd_collider_add gives a body more.
    DcdShapeId shape;
    // kg/m³, 0 or more. A dynamic body needs mass by this, `mass` or `extra_mass`; a mesh that is not closed and terrain have none by this.
    float density;
    // Kilograms of the shape, instead of those that follow from density; 0 is by density.
    float mass;
    // Coulomb coefficient, 0 or more.
    float friction;
    // 0 (no bounce) to 1 (all of the speed).
    float restitution;
    // DCD_COMBINE_…: what two bodies in contact use of their friction.
    DcdCombineRule friction_rule;
    // DCD_COMBINE_…: what they use of their restitution.
    DcdCombineRule restitution_rule;
    // Metres that the shape is kept away from others, 0 or more: a thin cushion makes contacts cheaper and calmer.
    float contact_skin;
    // Slows movement down: 1/s, 0 or more.
    float linear_damping;
    // Slows turning down: 1/s, 0 or more.
    float angular_damping;
    // Factor on gravity.
    float gravity_scale;
    // DCD_BODY_… bits.
    uint32_t flags;
    // DCD_LOCK_… bits: axes of the world that a dynamic body does not follow.
    uint32_t locked;
    // DCD_EVENT_… bits. A contact is told of when either body asks for it.
    uint32_t events;
    // Newtons above which DCD_EVENT_FORCE tells, 0 or more.
    float force_threshold;
    // Groups that the body belongs to, as bits.
    uint32_t groups;
    // Groups that it meets. Two bodies collide when each meets a group of the other.
    uint32_t mask;
    // Groups that it belongs to when it comes to pushing; contacts of others are told of and do nothing.
    uint32_t solver_groups;
    // Groups that push it and that it pushes.
    uint32_t solver_mask;
    // DCD_PAIR_… bits: which types of bodies it meets. A pair meets when either asks for it.
    uint32_t pairs;
    // -128 to 127: of two bodies the higher is not moved by the lower, which meets it like a wall.
    int32_t dominance;
    // Metres ahead that it looks for what it may meet: cheaper than DCD_BODY_CCD, and not as sure; 0 is none.
    float soft_ccd;
    // m/s below which it may fall asleep, 0 or more.
    float sleep_linear;
    // rad/s below which it may fall asleep, 0 or more.
    float sleep_angular;
    // Seconds it must have been so slow, 0 or more. In a served world these three must be as in DCD_BODY_DEF_INIT.
    float sleep_after;
    // Kilograms besides those of its shape, 0 or more. With extra_centre and extra_inertia 0 it makes the shape heavier as it
    // is.
    float extra_mass;
    // Where the extra mass is, from the body's origin, metres.
    float extra_centre[3];
    // Its moments of inertia about the body's x, y and z through that centre, kg m², 0 or more.
    float extra_inertia[3];
    // Iterations of the solver that it gets more than others, and what touches it; 0 to 1000.
    uint32_t extra_solver_iterations;
    // Iterations within each of them, 0 to 1000.
    uint32_t extra_pgs_iterations;
    // DCD_HOOK_… bits of its shape: the functions of dcd_hooks_set that are asked about it.
    uint32_t hooks;
    // Your own; events, views and ray hits carry it.
    uint64_t user_data;
    // Your own of its shape, as the number of a material (DcdColliderProperties.user_data); contacts and hits carry it.
    uint64_t material;
} DcdBodyDef;

// The settings of a character. Start from DCD_CHARACTER_DEF_INIT.
typedef struct DcdCharacterDef {
    // sizeof(DcdCharacterDef).
    uint32_t struct_size;
    // The highest step that it climbs without a jump, metres, 0 to 100; 0 to climb none.
    float step_height;
    // The free floor that there must be on a step, metres, 0 to 100.
    float step_depth;
    // The steepest slope that it climbs, radians, 0 to pi / 2.
    float max_climb;
    // The least steep slope that it slides down, radians, 0 to pi / 2.
    float min_slide;
    // The height by which it is drawn down to the ground as it walks downhill, metres, 0 to 100; 0 to be in the air instead.
    float snap;
    // The gap that it keeps from all else, metres, above 0 and at most 1.
    float gap;
    // The mass with which it pushes dynamic bodies and stands on them, kilograms, 0 to 1e9; 0 to push none.
    float mass;
    // 0.
    uint32_t reserved;
} DcdCharacterDef;

// A wheel of a vehicle. Points and directions are relative to the chassis. Start from DCD_WHEEL_INIT: of a car of a tonne, forward along
// x, upward along y, neither driven nor steered.
typedef struct DcdWheel {
    // The place where its suspension begins, metres, within 100 of the chassis.
    float at[3];
    // The direction in which its suspension points, of length 1.
    float down[3];
    // Its axle, of length 1: it rolls forward in the direction of axle x down.
    float axle[3];
    // The length of its suspension without a load, metres, 0 to 100.
    float rest_length;
    // The way by which the suspension is pressed from there at most, metres, 0 to 100.
    float travel;
    // Its radius, metres, above 0 and at most 100.
    float radius;
    // The stiffness of its suspension per kilogram of the chassis, 1/s², 0 to 1e9.
    float stiffness;
    // The damping of its suspension as it is pressed, per kilogram of the chassis, 1/s, 0 to 1e9.
    float compression;
    // The damping of its suspension as it is released, per kilogram of the chassis, 1/s, 0 to 1e9.
    float relaxation;
    // The greatest force of its suspension, newtons, 0 to 1e9.
    float max_force;
    // Its grip, 0 to 1000: across, and along twice as much, it holds up to this many times the force that its suspension bears.
    float grip;
    // The part of a sideways slip that it takes, 0 to 1: with 1 a fifth in each substep.
    float side_grip;
    // The force of the engine on it at full throttle, newtons, 0 to 1e9.
    float engine_force;
    // The force of its brake, newtons, 0 to 1e9.
    float brake_force;
    // The angle by which it turns when steered, radians, -pi / 2 to pi / 2; above 0 to the left.
    float steering;
} DcdWheel;

// The settings of a vehicle. Start from DCD_VEHICLE_DEF_INIT: a car of 3.2 x 1.6 m and about a tonne, driven behind, steered in front.
typedef struct DcdVehicleDef {
    // sizeof(DcdVehicleDef).
    uint32_t struct_size;
    // The number of wheels, 1 to 32; 0 for the four of that car.
    uint32_t wheel_count;
    // The wheels; null with a wheel_count of 0. They are copied.
    const DcdWheel *wheels;
    // The speed above which its engine does not speed it up, m/s, above 0 and at most 10000.
    float top_speed;
    // 0.
    uint32_t reserved;
} DcdVehicleDef;

// The controls of a vehicle.
typedef struct DcdDrive {
    // The part of the engine's force, -1 (backward) to 1.
    float throttle;
    // The part of the brakes' force, 0 to 1; with throttle it has no effect on wheels that are driven.
    float brake;
    // The part of the wheels' steering angle, -1 to 1.
    float steering;
} DcdDrive;

// The state of a body besides pose and velocity. Start from DCD_BODY_INFO_INIT.
typedef struct DcdBodyInfo {
    // sizeof(DcdBodyInfo).
    uint32_t struct_size;
    // DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    DcdBodyType body_type;
    // Your own.
    uint64_t user_data;
    // Its centre of mass, world space, metres; in a served world its origin.
    double centre[3];
    // Kilograms; 0 for a fixed body, and in a served world, where it is not told.
    float mass;
    // The region that owns it, as in DcdRegionInfo; DCD_NO_REGION for a fixed body and an avatar that has
    // not appeared yet. In a served world as DcdOwner.region.
    uint32_t region;
    // The force that dcd_body_set_force and dcd_body_add_force put on it, newtons.
    float force[3];
    // The torque, newton metres.
    float torque[3];
    // Number of its colliders.
    uint32_t colliders;
    // Whether it sleeps: it costs nothing until something wakes it.
    bool sleeping;
    // Whether your interest does not reach it (dcd_interest_set): what is told here is what was last heard of it.
    bool outside;
    // 0.
    uint8_t reserved[2];
} DcdBodyInfo;

// An explosion. Start from DCD_EXPLOSION_INIT and give its centre. It may grow at its end.
typedef struct DcdExplosion {
    // sizeof(DcdExplosion).
    uint32_t struct_size;
    // Only colliders that are in one of these groups; 0xFFFFFFFF for all.
    uint32_t mask;
    // Where, metres.
    double centre[3];
    // Up to where it has its full strength, metres, 0 or more: to the nearest point of a collider.
    float radius;
    // How far beyond it weakens, linearly down to nothing, metres, 0 or more.
    float falloff;
    // The impulse per area of the silhouette that a collider shows it, N s/m²; negative draws bodies in.
    float impulse;
    // 0.
    uint32_t reserved;
} DcdExplosion;

// A fluid, water or air, in a box. Start from DCD_FLUID_INIT. It may grow at its end.
typedef struct DcdFluid {
    // sizeof(DcdFluid).
    uint32_t struct_size;
    // Only colliders that are in one of these groups; 0xFFFFFFFF for all.
    uint32_t mask;
    // Lowest corner of where it is, metres; may be infinite.
    double min[3];
    // Highest corner.
    double max[3];
    // How high it stands, metres from the origin against gravity (along +y without gravity); infinite where it fills its box.
    double surface;
    // kg/m³, 0 or more.
    float density;
    // How it flows, or the wind blows, m/s.
    float velocity[3];
    // The coefficient c of drag, 0 or more: 0.5 for balls, 1 for boxes.
    float drag;
    // How fast motion and spin die down besides, of a body as heavy as what it displaces, 1/s, 0 or more.
    float damping;
    // The coefficient l of dynamic lift, 0 or more: 1 for plates, 0 for none.
    float lift;
    // 0.
    uint32_t reserved;
} DcdFluid;

// The properties of a body, but for those of its colliders: the members of DcdBodyDef, to be read and changed later. Start from
// DCD_BODY_PROPERTIES_INIT and dcd_body_properties.
typedef struct DcdBodyProperties {
    // sizeof(DcdBodyProperties).
    uint32_t struct_size;
    // DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    DcdBodyType body_type;
    // DCD_BODY_CCD, _NO_SLEEP, _DISABLED, _FAST_SPIN and _NO_GYRO bits.
    uint32_t flags;
    // DCD_LOCK_… bits.
    uint32_t locked;
    // As in DcdBodyDef, and so all that follows.
    int32_t dominance;
    // 1/s.
    float linear_damping;
    // 1/s.
    float angular_damping;
    // Factor on gravity.
    float gravity_scale;
    // Metres.
    float soft_ccd;
    // m/s.
    float sleep_linear;
    // rad/s.
    float sleep_angular;
    // Seconds.
    float sleep_after;
    // Kilograms.
    float extra_mass;
    // Metres.
    float extra_centre[3];
    // kg m², about the body's x, y and z; of a part of a model (MJCF, URDF) about the part's principal axes, which may be turned on the
    // body, and which stay until its extra_mass is 0.
    float extra_inertia[3];
    // Iterations of the solver.
    uint32_t extra_solver_iterations;
    // Iterations within each of them.
    uint32_t extra_pgs_iterations;
    // 0.
    uint32_t reserved;
    // Your own.
    uint64_t user_data;
} DcdBodyProperties;

// The properties of one collider of a body. Start from DCD_COLLIDER_PROPERTIES_INIT, or from dcd_collider_properties.
typedef struct DcdColliderProperties {
    // sizeof(DcdColliderProperties).
    uint32_t struct_size;
    // DCD_COLLIDER_… bits.
    uint32_t flags;
    // Where it sits on the body.
    DcdFrame frame;
    // kg/m³, 0 or more. Read later, it is 0 where the mass was given, or centre and inertia with it (by Rapier's own setters).
    float density;
    // Kilograms; 0 follows from the density.
    float mass;
    // As in DcdBodyDef, and so all that follows.
    float friction;
    // 0 to 1.
    float restitution;
    // DCD_COMBINE_….
    DcdCombineRule friction_rule;
    // DCD_COMBINE_….
    DcdCombineRule restitution_rule;
    // Metres.
    float contact_skin;
    // DCD_EVENT_… bits.
    uint32_t events;
    // Newtons.
    float force_threshold;
    // As bits.
    uint32_t groups;
    // As bits.
    uint32_t mask;
    // As bits.
    uint32_t solver_groups;
    // As bits.
    uint32_t solver_mask;
    // DCD_PAIR_… bits.
    uint32_t pairs;
    // DCD_HOOK_… bits: the functions of dcd_hooks_set that are asked about it.
    uint32_t hooks;
    // Your own of this collider, as the number of its material; contacts and hits carry it.
    uint64_t user_data;
} DcdColliderProperties;

// The kind of a shape. Others may come: take what you do not know by its vertices and triangles.
typedef uint32_t DcdShapeKind;

// What a shape is. Start from DCD_SHAPE_INFO_INIT.
typedef struct DcdShapeInfo {
    // sizeof(DcdShapeInfo).
    uint32_t struct_size;
    // DCD_SHAPE_BOX and so on.
    DcdShapeKind kind;
    // Metres; 0 of a kind that has none.
    float size[3];
    // Metres by which it is rounded: it reaches so far beyond its size or its vertices.
    float border;
    // Where all this is, from the shape's origin: elsewhere only of capsules and half-spaces that lie otherwise.
    DcdFrame frame;
    // How many vertices dcd_shape_vertices reads; 0 of boxes, balls, capsules, cylinders, cones, half-spaces and compounds.
    uint32_t vertex_count;
    // How many triangles dcd_shape_triangles reads.
    uint32_t triangle_count;
    // Of terrain: heights along z.
    uint32_t rows;
    // Of terrain: heights along x.
    uint32_t columns;
    // Of a compound: how many shapes dcd_shape_part has.
    uint32_t parts;
    // 0.
    uint32_t reserved;
} DcdShapeInfo;

// How large and heavy a body is. Start from DCD_BODY_EXTENT_INIT.
typedef struct DcdBodyExtent {
    // sizeof(DcdBodyExtent).
    uint32_t struct_size;
    // Kilograms; 0 for a fixed body.
    float mass;
    // The lowest corner of the smallest box along the axes of world space that holds its colliders, metres; infinite for a
    // half-space.
    double min[3];
    // The highest corner.
    double max[3];
    // Its centre of mass, from its origin, along its own axes, metres.
    float centre[3];
    // Its moments of inertia about its principal axes through that centre, kg m²; 0 for a fixed body.
    float inertia[3];
    // The rotation from its own axes to the principal ones: unit quaternion x, y, z, w.
    float axes[4];
} DcdBodyExtent;

// The type of a joint: what it lets free. Each type has axes of its own, which `limit` and `motor` of DcdJointDef are for.
typedef uint32_t DcdJointType;

// The model of a motor: whether stiffness and damping are per unit of mass.
typedef uint32_t DcdMotorModel;

// A motor of an axis: stiffness * (position - where it is) + damping * (velocity - how fast it moves), at most max_force. Start
// from DCD_JOINT_MOTOR_INIT, which holds the axis still by any force. For a speed give `velocity`; for a servo `position`,
// `stiffness` and `damping`.
typedef struct DcdJointMotor {
    // Where to, metres or radians.
    float position;
    // How fast, m/s or rad/s.
    float velocity;
    // 0 or more; 0 heeds the velocity alone.
    float stiffness;
    // 0 or more.
    float damping;
    // Most force or torque, newtons or newton metres: finite, 0 or more.
    float max_force;
    // DCD_MOTOR_ACCELERATION or DCD_MOTOR_FORCE.
    DcdMotorModel model;
} DcdJointMotor;

// The definition of a joint. Start from DCD_JOINT_DEF_INIT and give `a` and `b`.
typedef struct DcdJointDef {
    // sizeof(DcdJointDef).
    uint32_t struct_size;
    // DCD_JOINT_FIXED to DCD_JOINT_GENERIC.
    DcdJointType joint_type;
    // First body.
    DcdBodyId a;
    // Second body, another one.
    DcdBodyId b;
    // Where the joint sits on `a`; it brings the two frames together.
    DcdFrame frame_a;
    // Where it sits on `b`.
    DcdFrame frame_b;
    // Lowest and highest position of `b` seen from `a` along or about the type's own axes, with DCD_JOINT_LIMIT. -INFINITY and
    // INFINITY leave a side open.
    float limit[2];
    // Drives the type's own axes, with DCD_JOINT_MOTOR.
    DcdJointMotor motor;
    // DCD_JOINT_LIMIT, _MOTOR, _COLLIDE, _DISABLED bits.
    uint32_t flags;
    // Of DCD_JOINT_GENERIC: axes that it does not let free, as bits 1 << DCD_AXIS_…; else 0.
    uint32_t locked;
    // Of DCD_JOINT_GENERIC: free axes that count as one, as bits: two or three along, whose position is their common distance,
    // and two about, whose position is the angle between the third axes, as of a cone. They have one limit, and those along
    // have one motor. Else 0.
    uint32_t coupled;
    // How stiffly it holds what it locks and limits: hertz, above 0. Less than 1 / dt is soft.
    float natural_frequency;
    // How fast an error of it calms down, 0 or more; 1 is without swinging.
    float damping_ratio;
    // 0.
    uint32_t reserved;
    // Your own; dcd_joint_info gives it back.
    uint64_t user_data;
} DcdJointDef;

// A joint. 0 is null; an id is not given again, but after dcd_checkpoint_restore, and of builders' joints, as for bodies.
typedef struct DcdJointId {
    // Opaque.
    uint64_t v;
} DcdJointId;

// The state of a joint. Start from DCD_JOINT_INFO_INIT.
typedef struct DcdJointInfo {
    // sizeof(DcdJointInfo).
    uint32_t struct_size;
    // By what it lets free: one made generic may be a hinge, and a rope with a motor is a spring.
    DcdJointType joint_type;
    // First body.
    DcdBodyId a;
    // Second body.
    DcdBodyId b;
    // Your own.
    uint64_t user_data;
    // Where it sits on `a`.
    DcdFrame frame_a;
    // Where it sits on `b`.
    DcdFrame frame_b;
    // frame_b seen from frame_a, as the bodies are now.
    DcdFrame offset;
    // Angle of a revolute joint, -π to π; way of a prismatic one; distance of a rope or spring; else 0.
    float position;
    // Force that held the axes along x, y and z of frame_a that it locks, in the last step, newtons. Rapier mixes what it solves, so
    // take it for an estimate, as of what should break the joint.
    float force[3];
    // As in DcdJointDef.
    float natural_frequency;
    // As in DcdJointDef.
    float damping_ratio;
    // DCD_JOINT_LIMIT, _MOTOR, _COLLIDE, _DISABLED bits.
    uint32_t flags;
    // Axes that are not free, as bits 1 << DCD_AXIS_….
    uint32_t locked;
    // Axes that count as one.
    uint32_t coupled;
    // Axes with a limit.
    uint32_t limited;
    // Axes with a motor.
    uint32_t driven;
} DcdJointInfo;

// An axis of a joint's frame on body `a`: along it, or about it. As a bit it is 1 << axis, which DCD_LOCK_… are.
typedef uint32_t DcdJointAxis;

// A task of the library: to be called once, on any thread, with the `task` that came with it. It returns when the step needs it no more.
typedef void (*DcdTaskFn)(void *task);

// Starts `run(task)` on a thread of the program's and returns at once, with anything by which to know it again. A job system that has no
// thread free may begin it later, or within DcdFinishFn: then it has nothing to do.
typedef void *(*DcdEnqueueFn)(void *context, DcdTaskFn run, void *task);

// Returns when the task that DcdEnqueueFn gave this for has returned; begins it if it was not begun.
typedef void (*DcdFinishFn)(void *context, void *started);

// The program's job system. Start from DCD_TASKS_INIT.
typedef struct DcdTasks {
    // sizeof(DcdTasks).
    uint32_t struct_size;
    // 0.
    uint32_t reserved;
    // The first argument of both functions.
    void *context;
    // Starts a task.
    DcdEnqueueFn enqueue;
    // Waits for one.
    DcdFinishFn finish;
} DcdTasks;

// How a world is stepped. Start from DCD_SETTINGS_INIT and dcd_settings. It may grow at its end.
typedef struct DcdSettings {
    // sizeof(DcdSettings).
    uint32_t struct_size;
    // Iterations of the solver per step, 1 to 1000.
    uint32_t solver_iterations;
    // m/s².
    float gravity[3];
    // Length of a step in seconds, above 0.
    float dt;
    // Units of length per metre, above 0: 100 if your numbers are centimetres. It scales the tolerances of the solver, the
    // thresholds of sleep and `max_correction`; gravity, `speed_limit`, densities and all else are numbers of your units.
    float length_unit;
    // DcdWorldDef.speed_limit: m/s, above 0, up to DCD_MAX_NUMBER.
    float speed_limit;
    // Natural frequency of contacts, 1/s, 0 or more: higher is stiffer.
    float contact_frequency;
    // Damping ratio of contacts, 0 or more: higher takes overlaps away more slowly.
    float contact_damping;
    // The same of contacts with fixed bodies.
    float static_frequency;
    // The same of contacts with fixed bodies.
    float static_damping;
    // m/s, 0 or more: faster than so no overlap is taken away.
    float max_correction;
    // Metres of overlap that are left as they are, 0 or more.
    float allowed_overlap;
    // Metres ahead at which contacts are looked for, 0 or more.
    float contact_margin;
    // The part of the last step's impulses that the next begins with, 0 to 1.
    float warm_start;
    // Iterations within each iteration of the solver, 1 to 1000.
    uint32_t internal_iterations;
    // The most substeps by which bodies with DCD_BODY_CCD are swept in a step, 0 to 1000.
    uint32_t ccd_substeps;
    // Disagreement of copies that DCD_COUPLING_AUTO tolerates, m/s, above 0.
    float tolerance;
    // 0.
    uint32_t reserved;
} DcdSettings;

// The state of every movable body after a step: entry i of each array belongs to ids[i], in an order that only changes where bodies are
// made or destroyed. Start from DCD_STATE_VIEW_INIT. The arrays are null when `count` is 0.
typedef struct DcdStateView {
    // sizeof(DcdStateView).
    uint32_t struct_size;
    // Above every slot of every view up to now: the length that an array of yours by slot needs.
    uint32_t slot_count;
    // After which step.
    uint64_t tick;
    // Length of each array.
    size_t count;
    // Which bodies.
    const DcdBodyId *ids;
    // Where they are.
    const DcdPose *poses;
    // How they move.
    const DcdVelocity *velocities;
    // Your own.
    const uint64_t *user_data;
    // DCD_STATE_… bits.
    const uint32_t *flags;
    // Their owners, as in DcdRegionInfo; of a server, which is told no owners, the regions that they lie in.
    const uint32_t *regions;
    // Where you may keep your own of the bodies, in an array beside: a body has its slot, below `slot_count`, in every view of its
    // world (dcd_state_view and dcd_view_state alike) for as long as views show it, whatever its place in them. Low slots are given
    // first. A slot that becomes free in a view is given anew in a later one, so none is of two bodies in two successive views; who
    // leaves views out, or calls dcd_checkpoint_restore, compares ids.
    const uint32_t *slots;
} DcdStateView;

// The field of a body that dcd_state_read and dcd_state_write copy.
typedef uint32_t DcdField;

// The ticks to show now. A fraction is a time between two ticks: 7.5 is halfway from the world after step 7 to that after step 8. Start
// from DCD_VIEW_TIME_INIT.
typedef struct DcdViewTime {
    // sizeof(DcdViewTime).
    uint32_t struct_size;
    // 0.
    uint32_t reserved;
    // The tick that the world is at, as far as known: for what must not lag, as an own avatar. What moves is extrapolated.
    double now;
    // The tick whose states have come by now, a little ago: for all else. It goes forward evenly, unless ticks are counted anew: where a
    // guess is withdrawn, or the world goes back to a save.
    double shown;
    // The tick that applies what an own avatar is asked now, where a client predicts (dcd_prediction_set): own avatars are shown at it,
    // with what they touch. Otherwise the same as `now`.
    double predicted;
    // The bound on the error of `now` that comes from clocks, seconds; below 0 until it is known, where no network is between,
    // and in a participant, which counts the way of what it is told as nothing.
    double clock_error;
    // The time from an input to the first state that shows it, seconds: the median of the last ones. Below 0 before the first.
    double input_delay;
} DcdViewTime;

// What is drawn: DCD_DRAW_... bits.
typedef uint32_t DcdDrawFlags;

// Draws a point that is `size` pixels wide, however far it is.
typedef void (*DcdDrawPointFn)(void *context, const double *at, float size, uint32_t colour);

// Draws a line between two points.
typedef void (*DcdDrawLineFn)(void *context, const double *from, const double *to, uint32_t colour);

// Draws a box along the axes of world space.
typedef void (*DcdDrawBoxFn)(void *context, const double *min, const double *max, uint32_t colour);

// The kind of a shape that is drawn; DCD_DRAWN_BOX to DCD_DRAWN_MESH. Others may come: skip what you do not know.
typedef uint32_t DcdDrawnKind;

// A shape that is drawn, about the origin of its pose. Rounded shapes are drawn as large as they are, with edges. It may grow at its end.
typedef struct DcdDrawnShape {
    // DCD_DRAWN_BOX and so on.
    DcdDrawnKind kind;
    // Which mesh it is: in one world the same number is the same mesh for ever, so that what a renderer makes of it can be kept.
    uint32_t mesh;
    // Metres.
    float size[3];
    // 0.
    uint32_t reserved;
    // Of a mesh: x, y, z of each corner, metres.
    const float *vertices;
    // How many corners.
    size_t vertex_count;
    // Of a mesh: three corners of each triangle, counterclockwise from outside.
    const uint32_t *triangles;
    // How many triangles.
    size_t triangle_count;
} DcdDrawnShape;

// Draws one shape of a body at its place in the world.
typedef void (*DcdDrawShapeFn)(void *context,
                               DcdBodyId body,
                               const DcdDrawnShape *shape,
                               const DcdPose *pose,
                               uint32_t colour);

// Writes a text that begins at a point and is turned to whoever looks.
typedef void (*DcdDrawTextFn)(void *context, const double *at, const char *text, uint32_t colour);

// What is drawn, and by which functions. Start from DCD_DEBUG_DRAW_INIT.
//
// Points are three doubles, in metres of world space; colours are 0xRRGGBBAA. What pointers lead to is valid during the call. Without
// draw_box or draw_shape their things are drawn by draw_line; what has no function otherwise is skipped.
typedef struct DcdDebugDraw {
    // sizeof(DcdDebugDraw).
    uint32_t struct_size;
    // DCD_DRAW_... bits.
    DcdDrawFlags flags;
    // The first argument of all functions.
    void *context;
    // Null: skipped.
    DcdDrawPointFn draw_point;
    // Null: skipped.
    DcdDrawLineFn draw_line;
    // Null: by draw_line.
    DcdDrawBoxFn draw_box;
    // Null: by draw_line.
    DcdDrawShapeFn draw_shape;
    // Null: skipped.
    DcdDrawTextFn draw_text;
    // Movable bodies with their origin outside this box, and contacts outside, are left out.
    double min[3];
    // Its other corner.
    double max[3];
    // The length of the line of a velocity, metres per m/s.
    float velocity_scale;
    // The length of the line of a force, metres per newton.
    float force_scale;
} DcdDebugDraw;

// What a client predicts, and how often it was wrong. Start from DCD_PREDICTION_INIT.
typedef struct DcdPrediction {
    // sizeof(DcdPrediction).
    uint32_t struct_size;
    // Movable bodies that are predicted now: own avatars and what is near them. 0 where nothing is predicted.
    uint32_t bodies;
    // Steps of the world predicted so far.
    uint64_t ticks;
    // Times that something was not as the world told then, and was computed again.
    uint64_t replays;
    // Those of them by which an own avatar, or what it touches, was shown more than 2 cm off.
    uint64_t corrections;
    // The largest of them, metres.
    double largest_correction;
    // What the predictions of the last dcd_view_time took, seconds.
    double last_frame;
    // The longest of these, seconds.
    double longest_frame;
} DcdPrediction;

// A connection of one world with another process; 0 is null. It outlives a link that breaks and is made anew.
typedef struct DcdConnectionId {
    // Opaque.
    uint64_t v;
} DcdConnectionId;

// The state of a connection.
typedef uint32_t DcdConnectionState;

// A connection as it is now. Start from DCD_CONNECTION_INFO_INIT.
typedef struct DcdConnectionInfo {
    // sizeof(DcdConnectionInfo).
    uint32_t struct_size;
    // DCD_CONNECTION_CAME while it has the link that it came with, _LOST while it has none, _BACK while it has another.
    DcdConnectionState state;
    // As in DcdConnectionEvent.
    DcdRole role;
    // As in DcdConnectionEvent.
    uint32_t node;
    // As in DcdConnectionEvent.
    uint32_t client;
    // Share of the packets sent that got lost on the way, 0 to 1.
    float loss;
    // There and back, milliseconds.
    double rtt_ms;
    // Seconds since it came.
    double age;
    // Bytes received over it, without those of QUIC itself; up to half a second old, as all numbers here.
    uint64_t bytes_in;
    // Bytes sent.
    uint64_t bytes_out;
    // Bytes of UDP received over it: those, and what QUIC adds, as DcdStats.udp_bytes_in.
    uint64_t udp_bytes_in;
    // Bytes of UDP sent.
    uint64_t udp_bytes_out;
    // Messages received, dcd's own and those of programs, and datagrams.
    uint64_t messages_in;
    // Messages and datagrams sent.
    uint64_t messages_out;
    // Datagrams dropped at this end: the link was full, or nobody took them.
    uint64_t dropped;
    // Bytes that wait because the link or the other end is slow.
    uint64_t bytes_waiting;
} DcdConnectionInfo;

// A contact event: two bodies began or ceased to touch. Told when either has DCD_EVENT_CONTACT, once per pair, whatever regions see it; in
// a served world, of avatars of this process.
typedef struct DcdContact {
    // The body made first: of two that which dcd_bodies lists first. It is stale when it was destroyed since.
    DcdBodyId a;
    // The other one.
    DcdBodyId b;
    // Your own of `a`.
    uint64_t user_a;
    // Your own of `b`.
    uint64_t user_b;
    // Where, in world space, metres; 0 for ends.
    double point[3];
    // From a to b, of length 1; 0 for sensors and ends.
    float normal[3];
    // At which they approached, m/s; 0 for ends.
    float speed;
    // DCD_CONTACT_BEGAN or DCD_CONTACT_ENDED.
    uint32_t kind;
    // DCD_CONTACT_… bits.
    uint32_t flags;
    // Which collider of `a`, from 0: bodies of scenes may have several.
    uint32_t collider_a;
    // Which collider of `b`.
    uint32_t collider_b;
    // The user_data of that collider of `a` (DcdBodyDef.material, DcdColliderProperties.user_data); 0 once the body is gone.
    uint64_t material_a;
    // The same of `b`.
    uint64_t material_b;
} DcdContact;

// A contact force event: a contact pressed harder than the force_threshold of a body with DCD_EVENT_FORCE.
typedef struct DcdContactForce {
    // As in DcdContact.
    DcdBodyId a;
    // The other one.
    DcdBodyId b;
    // Your own of `a`.
    uint64_t user_a;
    // Your own of `b`.
    uint64_t user_b;
    // Sum of the forces on `b`, newtons, world axes.
    float force[3];
    // Sum of their magnitudes, newtons.
    float magnitude;
    // Which collider of `a`, from 0.
    uint32_t collider_a;
    // Which collider of `b`.
    uint32_t collider_b;
    // As in DcdContact.
    uint64_t material_a;
    // As in DcdContact.
    uint64_t material_b;
} DcdContactForce;

// A transfer: a body changed owner in the step. Putting it elsewhere by hand is not told of. In a served world: it was heard of
// in the step, and another region owned it than when it was heard of before. That is exact for both times, and leaves out what it went
// through between them; nothing is told of bodies whose owner was not known before (DCD_OWNER_BY_PLACE), of bodies outside the
// interest, and of regions that another node computes now.
typedef struct DcdTransfer {
    // Which body.
    DcdBodyId body;
    // Your own.
    uint64_t user_data;
    // The region that owned it, as in DcdRegionInfo.
    uint32_t from;
    // The region that owns it now.
    uint32_t to;
} DcdTransfer;

// A change of a body of a served world: it appeared, is gone, or an input was refused. Bodies that were there on joining are not
// told of, and nothing is in a local world.
typedef struct DcdBodyChange {
    // Which body; null when a refusal concerns none.
    DcdBodyId body;
    // Your own, or that of whoever made it.
    uint64_t user_data;
    // DCD_BODY_APPEARED, _REMOVED or _REFUSED.
    uint32_t kind;
    // DCD_REFUSED_… of a refusal, else 0; dcd_refused_string names it.
    uint32_t reason;
} DcdBodyChange;

// The cause of a connection being lost or gone.
typedef uint32_t DcdCause;

// A change of the state of a connection.
typedef struct DcdConnectionEvent {
    // Which.
    DcdConnectionId connection;
    // DCD_CONNECTION_CAME, _LOST, _BACK or _GONE.
    DcdConnectionState state;
    // What is, or was, at the other end: DCD_ROLE_SERVER, _NODE, _CLIENT, _PARTICIPANT or _BUILDER.
    DcdRole role;
    // The number that the server knows it by as a node, from 1; 0 if it is none.
    uint32_t node;
    // As a client, as DcdWorldInfo.client; 0 if it is none.
    uint32_t client;
    // DCD_CAUSE_...: why it is lost or gone.
    DcdCause cause;
    // 0.
    uint32_t reserved;
    // The same in words, for people; empty with DCD_CAUSE_NONE. Cut to fit.
    char reason[DCD_MAX_REASON];
} DcdConnectionEvent;

// A message that the program at the other end of a connection sent by dcd_send.
typedef struct DcdMessage {
    // Over which connection; to answer by.
    DcdConnectionId connection;
    // The bytes, as they were sent, at an address for any type; null when there are none.
    const void *data;
    // How many.
    size_t size;
    // What the sender is, as in DcdConnectionEvent.
    DcdRole role;
    // As in DcdConnectionEvent.
    uint32_t node;
    // As in DcdConnectionEvent.
    uint32_t client;
    // DCD_SEND_… bits.
    uint32_t flags;
} DcdMessage;

// A joint that bore more than its strength in the step (dcd_joint_strength_set), in a local world. Whether it breaks is yours to decide:
// dcd_joint_destroy does so.
typedef struct DcdJointOverload {
    // Which joint.
    DcdJointId joint;
    // Your own.
    uint64_t user_data;
    // The force on its locked axes, newtons.
    float force;
    // The torque on its locked axes as Rapier's solver has it, newton metres: not that about the anchor, unless this is the
    // body's centre of mass.
    float torque;
} DcdJointOverload;

// The events of the last step. Start from DCD_EVENT_VIEW_INIT. Arrays are null when their count is 0.
typedef struct DcdEventView {
    // sizeof(DcdEventView).
    uint32_t struct_size;
    // DCD_EVENTS_… bits.
    uint32_t flags;
    // After which step.
    uint64_t tick;
    // Contacts that began or ended, by bodies.
    const DcdContact *contacts;
    // How many.
    size_t contact_count;
    // Contacts that pressed hard, by bodies.
    const DcdContactForce *forces;
    // How many.
    size_t force_count;
    // Bodies that changed owner, or were heard to; in a served world in the order in which that was heard, of more than 4096 the
    // newest.
    const DcdTransfer *transfers;
    // How many.
    size_t transfer_count;
    // Bodies of a served world that came and went, and refusals.
    const DcdBodyChange *changes;
    // How many.
    size_t change_count;
    // What became of a served world's connections, in order; of more than 4096 the newest.
    const DcdConnectionEvent *connections;
    // How many.
    size_t connection_count;
    // What programs of other processes sent to this one, in the order in which it came. Their bytes live as long as the array.
    const DcdMessage *messages;
    // How many.
    size_t message_count;
    // Joints that bore more than their strength, by age.
    const DcdJointOverload *overloads;
    // How many.
    size_t overload_count;
} DcdEventView;

// A point at which two bodies touch, or are about to.
typedef struct DcdContactPoint {
    // The body made first.
    DcdBodyId a;
    // The other one.
    DcdBodyId b;
    // Where, in the middle between the two surfaces, world space, metres.
    double point[3];
    // From a to b, of length 1.
    float normal[3];
    // Metres between the surfaces, negative where they overlap.
    float separation;
    // The impulse along the normal on `b` in the last step, N s; without friction. Divided by dt it is the force.
    float impulse;
    // The number of its manifold among those of the two colliders: points of one manifold have one normal.
    uint32_t manifold;
    // Which collider of `a`, from 0.
    uint32_t collider_a;
    // Which collider of `b`.
    uint32_t collider_b;
    // The user_data of that collider of `a`, as the number of a material.
    uint64_t material_a;
    // The same of `b`.
    uint64_t material_b;
} DcdContactPoint;

// Says what becomes of a pair: the answer of DcdHooks.filter.
typedef uint32_t DcdPairAnswer;

// Two colliders that a hook is asked about.
typedef struct DcdHookedPair {
    // The body made first.
    DcdBodyId a;
    // The other one.
    DcdBodyId b;
    // Your own of `a`.
    uint64_t user_a;
    // Your own of `b`.
    uint64_t user_b;
    // The user_data of the collider of `a`, as the number of a material.
    uint64_t material_a;
    // The same of `b`.
    uint64_t material_b;
    // Which collider of `a`, from 0.
    uint32_t collider_a;
    // Which collider of `b`.
    uint32_t collider_b;
    // The pose of `a`.
    DcdPose pose_a;
    // The pose of `b`.
    DcdPose pose_b;
    // The velocity of `a`.
    DcdVelocity velocity_a;
    // The velocity of `b`.
    DcdVelocity velocity_b;
} DcdHookedPair;

// Returns whether two colliders meet: DCD_MEET_PUSH, DCD_MEET_TOUCH or DCD_MEET_NOT.
typedef DcdPairAnswer (*DcdFilterFn)(void *context, const DcdHookedPair *pair);

// Returns whether a sensor detects another collider.
typedef bool (*DcdDetectFn)(void *context, const DcdHookedPair *pair);

// A contact that is about to be solved, of one manifold: several points with one normal.
typedef struct DcdHookedContact {
    // From a to b, of length 1; to be read.
    float normal[3];
    // The least separation of its points, metres, negative where they overlap; to be read.
    float separation;
    // How many points it has; to be read.
    uint32_t points;
    // 1; 0 takes the contact out of this step: they touch and do not push.
    uint32_t enabled;
    // Coulomb coefficient, 0 or more.
    float friction;
    // 0 to 1.
    float restitution;
    // The velocity of the surface of `a` against that of `b`, world axes, m/s: so a conveyor belt `a` carries `b` along; of a belt that is `b`,
    // give the negative. 0 at first.
    float surface_velocity[3];
    // A number of yours that the manifold keeps while it lasts; 0 at first, and where bodies come to another region.
    uint32_t memory;
} DcdHookedContact;

// Changes a contact.
typedef void (*DcdModifyFn)(void *context, const DcdHookedPair *pair, DcdHookedContact *contact);

// Functions that are asked about contacts. Start from DCD_HOOKS_INIT.
typedef struct DcdHooks {
    // sizeof(DcdHooks).
    uint32_t struct_size;
    // 0.
    uint32_t reserved;
    // The first argument of all functions.
    void *context;
    // Asked about colliders that touch, of which one has DCD_HOOK_FILTER. Null: they push.
    DcdFilterFn filter;
    // Asked about sensors and what is in them, of which one has DCD_HOOK_DETECT. Null: they detect.
    DcdDetectFn detect;
    // Asked about contacts of colliders, of which one has DCD_HOOK_MODIFY. Null: they stay.
    DcdModifyFn modify;
} DcdHooks;

// A ray. Start from DCD_RAY_INIT and give a direction.
typedef struct DcdRay {
    // Where it starts, world space, metres.
    double origin[3];
    // Where it goes, of any length above 0.
    float direction[3];
    // How far, metres, above 0; INFINITY is allowed.
    float max_distance;
    // A body that it passes through, as the one that looks; null for none.
    DcdBodyId exclude;
    // Groups that it meets, as in DcdBodyDef.groups; 0xFFFFFFFF for all.
    uint32_t mask;
    // DCD_QUERY_HOLLOW or 0.
    uint32_t flags;
} DcdRay;

// A filter: what all queries of a call overlook. Start from DCD_FILTER_INIT, which overlooks nothing.
typedef struct DcdFilter {
    // sizeof(DcdFilter).
    uint32_t struct_size;
    // DCD_FILTER_… bits.
    uint32_t flags;
    // Groups that the queries belong to: colliders whose mask meets none of them are overlooked. 0 asks no collider's mask.
    uint32_t groups;
    // Groups that the queries meet; 0xFFFFFFFF for all.
    uint32_t mask;
    // Bodies that are overlooked; null when there are none.
    const DcdBodyId *exclude;
    // How many.
    size_t exclude_count;
} DcdFilter;

// A body that a ray met.
typedef struct DcdRayHit {
    // Which; null when the ray met nothing, and then all else is 0.
    DcdBodyId body;
    // Its user data.
    uint64_t user_data;
    // Where, world space, metres.
    double point[3];
    // Outward, of length 1; 0 when the ray starts inside the body.
    float normal[3];
    // From the origin, metres.
    float distance;
    // Which collider of the body, from 0.
    uint32_t collider;
    // Which triangle of a mesh or terrain, which part of a compound; else 0.
    uint32_t subshape;
    // The user_data of that collider, as the number of a material.
    uint64_t material;
} DcdRayHit;

// A shape that moves straight, and may turn on the way. Start from DCD_SHAPE_CAST_INIT and give shape and motion.
typedef struct DcdShapeCast {
    // Of the same world. It cannot be a mesh or terrain.
    DcdShapeId shape;
    // Where it starts.
    DcdPose pose;
    // How far its origin moves, metres.
    float motion[3];
    // By how much it turns on the way: about this axis of the world, by its length in radians. 0 is cheaper.
    float turn[3];
    // Metres from a body at which it counts as there, 0 or more; 0 if it turns.
    float margin;
    // Groups that it meets; 0xFFFFFFFF for all.
    uint32_t mask;
    // A body that it passes through; null for none.
    DcdBodyId exclude;
    // DCD_QUERY_LEAVE or 0.
    uint32_t flags;
    // 0.
    uint32_t reserved;
} DcdShapeCast;

// The first body that a moving shape met.
typedef struct DcdShapeHit {
    // Which; null when the shape met nothing, and then all else is 0.
    DcdBodyId body;
    // Its user data.
    uint64_t user_data;
    // Where on the body, world space, metres.
    double point[3];
    // Outward of the body there, of length 1.
    float normal[3];
    // How much of its way the shape came, 0 to 1.
    float fraction;
    // Where on the shape, in its own space, metres.
    float point_on_shape[3];
    // Outward of the shape there, in its own space.
    float normal_on_shape[3];
    // Which collider of the body, from 0.
    uint32_t collider;
    // As in DcdRayHit.
    uint32_t subshape;
    // DCD_HIT_INSIDE or 0.
    uint32_t flags;
    // 0.
    uint32_t reserved;
    // The user_data of that collider, as the number of a material.
    uint64_t material;
} DcdShapeHit;

// A point. Start from DCD_POINT_QUERY_INIT.
typedef struct DcdPointQuery {
    // World space, metres.
    double point[3];
    // Of dcd_project_points: how far a place may be, metres, 0 or more; INFINITY is allowed.
    float max_distance;
    // Groups that it meets; 0xFFFFFFFF for all.
    uint32_t mask;
    // A body that is overlooked; null for none.
    DcdBodyId exclude;
    // Of dcd_project_points: DCD_QUERY_HOLLOW or 0; else 0.
    uint32_t flags;
    // 0.
    uint32_t reserved;
} DcdPointQuery;

// The place of a body nearest to a point.
typedef struct DcdPointHit {
    // Whose; null when there is none near enough, and then all else is 0.
    DcdBodyId body;
    // Its user data.
    uint64_t user_data;
    // Where, world space, metres.
    double point[3];
    // From the point that was asked about, metres.
    float distance;
    // Which collider of the body, from 0.
    uint32_t collider;
    // DCD_HIT_INSIDE or 0.
    uint32_t flags;
    // 0.
    uint32_t reserved;
    // The user_data of that collider, as the number of a material.
    uint64_t material;
} DcdPointHit;

// A shape at a pose, to find what overlaps it. Start from DCD_SHAPE_QUERY_INIT and give a shape.
typedef struct DcdShapeQuery {
    // Of the same world. It cannot be a mesh or terrain.
    DcdShapeId shape;
    // Where.
    DcdPose pose;
    // A body that is overlooked; null for none.
    DcdBodyId exclude;
    // Groups that it meets; 0xFFFFFFFF for all.
    uint32_t mask;
    // 0.
    uint32_t reserved;
} DcdShapeQuery;

// A body that overlaps something.
typedef struct DcdOverlap {
    // Which.
    DcdBodyId body;
    // Its user data.
    uint64_t user_data;
    // Which collider of it, from 0.
    uint32_t collider;
    // 0.
    uint32_t reserved;
    // The user_data of that collider, as the number of a material.
    uint64_t material;
} DcdOverlap;

// A box along the axes of the world (AABB). Corners may be infinite. Start from DCD_BOX_QUERY_INIT and give them.
typedef struct DcdBoxQuery {
    // Lowest corner, metres.
    double min[3];
    // Highest corner.
    double max[3];
    // A body that is overlooked; null for none.
    DcdBodyId exclude;
    // Groups that it meets; 0xFFFFFFFF for all.
    uint32_t mask;
    // 0.
    uint32_t reserved;
} DcdBoxQuery;

// Called with a body that a ray met; `hit` is valid during the call. Returns how far the ray goes from now on, metres: INFINITY for as far as
// it did, hit->distance to be called for nearer bodies only, 0 to end.
//
// It is called on the thread that asks, must return normally (no longjmp, no C++ exception), and calls on worlds from within it give
// DCD_ERR_BUSY.
typedef float (*DcdRayFn)(void *context, const DcdRayHit *hit);

// Called with a body that a moving shape met. Returns how much of its way the shape goes from now on: 1 for as much as it did, hit->fraction
// to be called for bodies that it meets earlier only, 0 to end. As DcdRayFn else.
typedef float (*DcdShapeCastFn)(void *context, const DcdShapeHit *hit);

// Called with a body that was found; `found` is valid during the call. Returns whether to go on. As DcdRayFn else.
typedef bool (*DcdOverlapFn)(void *context, const DcdOverlap *found);

// Rays, casts or overlaps that were submitted and whose answer was not fetched yet. 0 is null; an id is never given again.
typedef struct DcdQueryId {
    // Opaque.
    uint64_t v;
} DcdQueryId;

// A region: a box of the world whose bodies one Rapier world computes. Outer faces lie at infinity.
typedef struct DcdRegionInfo {
    // Its number in the tree of regions; numbers need not be dense.
    uint32_t region;
    // Bodies that it owns; in a served world, of those that are known, by what dcd_body_owner says.
    uint32_t bodies;
    // Ghosts that it holds: copies of bodies that its neighbours own; 0 in a served world.
    uint32_t replicas;
    // The node that computes it, as the server numbers nodes from 1, as last told: it may have changed hands some milliseconds
    // ago. DCD_NO_NODE in a local world, and while nobody computes.
    uint32_t node;
    // Lowest corner, inside, metres.
    double min[3];
    // Highest corner, outside, metres.
    double max[3];
} DcdRegionInfo;

// A border between two regions.
typedef struct DcdBorderInfo {
    // The region of the lower number, as in DcdRegionInfo.
    uint32_t a;
    // The other.
    uint32_t b;
    // Movable bodies that both hold, whoever owns them.
    uint32_t bodies;
    // How often the two come to consensus in the next step; with DCD_COUPLING_AUTO as often as the border came to need.
    uint32_t exchanges;
    // Contact hops across the border within which bodies live in both regions, at the side where it is more; 0 with
    // DCD_COUPLING_OWNER and _PROXY.
    uint32_t depth;
    // How far the copies of a body were from agreement here in the last step, summed over its exchanges, m/s; an estimate of
    // the error that the border makes. 0 with DCD_COUPLING_OWNER and _PROXY.
    float disagreement;
} DcdBorderInfo;

// The owner of a body: the region with authority over it. Start from DCD_OWNER_INIT.
typedef struct DcdOwner {
    // sizeof(DcdOwner).
    uint32_t struct_size;
    // Its region, as in DcdRegionInfo; DCD_NO_REGION for a fixed body, which every region near it has, and for an avatar that
    // has not appeared yet. In a served world, the one that owned the body when it was last heard of: exactly, unless
    // DCD_OWNER_BY_PLACE is set.
    uint32_t region;
    // The node that computes the region, as DcdRegionInfo.node.
    uint32_t node;
    // Regions that hold the body, its owner included; 0 in a served world, where it is not told.
    uint32_t holders;
    // DCD_OWNER_… bits. In a participant both may be set.
    uint32_t flags;
} DcdOwner;

// Counters of a world. Start from DCD_STATS_INIT.
typedef struct DcdStats {
    // sizeof(DcdStats).
    uint32_t struct_size;
    // Regions that the world is cut into.
    uint32_t regions;
    // Steps done; the newest heard of in a served world.
    uint64_t ticks;
    // Movable bodies.
    uint64_t bodies;
    // Ghosts: copies of bodies in regions that do not own them; 0 in a served world, as the next two.
    uint64_t replicas;
    // Bodies that changed owner in a step, ever.
    uint64_t transfers;
    // Copies set aside because their numbers were not finite; 0 unless something is wrong.
    uint64_t quarantined;
    // Messages with states of bodies received, ever; 0 in a local world.
    uint64_t updates;
    // Bytes received, without those of QUIC itself; 0 in a local world, as the next four. A tenth of a second old.
    uint64_t bytes_in;
    // Bytes sent.
    uint64_t bytes_out;
    // Bytes of UDP received: those, and what QUIC adds. What a link is charged for, but for 28 (IPv6: 48) bytes of headers per packet.
    uint64_t udp_bytes_in;
    // Bytes of UDP sent.
    uint64_t udp_bytes_out;
    // Time to the slowest peer and back, seconds.
    double rtt;
    // Wall time of the last step, seconds; of taking in what had come, in a served world.
    double last_step;
    // How far copies of a body in different regions were from agreement at the worst border in the last step, summed over
    // its exchanges, m/s: an estimate of the error that borders make. 0 with DCD_COUPLING_OWNER and _PROXY, and in a served world.
    float disagreement;
    // Exchanges between regions in the last step, at the border that took most; 0 in a world of one region and in a
    // served one.
    uint32_t exchanges;
} DcdStats;

// What the last step took, in seconds, and what was computed in it: sums over all regions, which compute side by side, so that times may be more
// than DcdStats.last_step. Start from DCD_PROFILE_INIT. It may grow at its end.
typedef struct DcdProfile {
    // sizeof(DcdProfile).
    uint32_t struct_size;
    // 0.
    uint32_t reserved;
    // Steps of Rapier, all phases.
    double rapier;
    // Finding pairs whose boxes touch. This and the next four are 0 in a library that was built without the feature `profiler`.
    double broad_phase;
    // Finding contacts.
    double narrow_phase;
    // Keeping islands, and putting bodies to sleep.
    double islands;
    // Solving contacts and joints, and moving bodies.
    double solver;
    // Sweeping fast bodies.
    double ccd;
    // Exchange of messages between regions: wall time.
    double border;
    // Pairs of colliders near enough for contacts; those that regions share count in each, as in all that follows.
    uint64_t contact_pairs;
    // Points of contact that were solved.
    uint64_t contacts;
    // Bodies that were awake.
    uint64_t awake;
    // Joints, awake or not.
    uint64_t joints;
    // Islands that are awake now: groups of bodies that touch or are tied.
    uint64_t islands_awake;
    // Memory that bodies, colliders, contacts and joints take, roughly, bytes: not that of shapes, nor what is kept for the next step.
    uint64_t memory;
} DcdProfile;

// A local world as it was between two steps. 0 is null; an id is never given again.
typedef struct DcdCheckpointId {
    // Opaque.
    uint64_t v;
} DcdCheckpointId;

// A place that a world is looked at from.
typedef struct DcdViewpoint {
    // World space, metres.
    double at[3];
    // How far is looked, metres, 0 or more: regions within it are computed in full.
    double radius;
} DcdViewpoint;

// What fidelity saved and what it cost, as far as is known. Start from DCD_FIDELITY_REPORT_INIT. It may grow at its end.
typedef struct DcdFidelityReport {
    // sizeof(DcdFidelityReport).
    uint32_t struct_size;
    // The mean error of a body's velocity per step against a model four times as fine, m/s, by audits of the last steps; 0
    // before the first, and where all is computed in full.
    float error;
    // The lower end of its 95 % confidence interval, m/s.
    float low95;
    // The upper end; infinite before two audits, and 0 where all is computed in full.
    float high95;
    // The time of regions' steps over what they would have taken had each been stepped in every step, as reckoned.
    double share_of_full_time;
    // Audits so far.
    uint64_t audits;
    // Steps that took longer than the budget, since the first second.
    uint64_t overruns;
    // Regions that are stepped in every step, in every second one, and in every fourth.
    uint32_t levels[3];
    // 0.
    uint32_t reserved;
} DcdFidelityReport;

// The force and torque on a body in every step, in world axes.
typedef struct DcdForce {
    // At the centre of mass, newtons.
    float force[3];
    // Newton metres.
    float torque[3];
} DcdForce;

// Nothing.
#define DCD_LOG_OFF 0

// Something failed.
#define DCD_LOG_ERROR 1

// Something is not as it should be.
#define DCD_LOG_WARN 2

// Logs the milestones: who joins and leaves, views, failures of nodes.
#define DCD_LOG_INFO 3

// Logs every step of joins and view changes, and every failed call.
#define DCD_LOG_DEBUG 4

// Everything.
#define DCD_LOG_TRACE 5

// Computes all of it.
#define DCD_ROLE_LOCAL 0

// Hosts avatars in it; others compute it.
#define DCD_ROLE_CLIENT 1

// Hosts avatars in it, and computes a share of it.
#define DCD_ROLE_PARTICIPANT 2

// Holds it: decides who computes what, and lets others in.
#define DCD_ROLE_SERVER 3

// Computes a share of it.
#define DCD_ROLE_NODE 4

// Hosts avatars in it as a client, and may change what is the world's own as the server's program does.
#define DCD_ROLE_BUILDER 5

// Done.
#define DCD_OK 0

// A pointer or a handle that must be given is null.
#define DCD_ERR_NULL (-1)

// A handle names nothing here: what it named was destroyed, or belongs to another world.
#define DCD_ERR_STALE_ID (-2)

// A struct_size is not that of this library's struct; start from the DCD_…_INIT macro.
#define DCD_ERR_STRUCT (-3)

// A value is out of range: NaN, a negative size, an unknown constant, a count above DCD_MAX_ITEMS.
#define DCD_ERR_ARGUMENT (-4)

// The caller's memory is too small; the size needed was written. Who asks for the size, by null with room for 0, gets it with DCD_OK.
#define DCD_ERR_SMALL_BUFFER (-5)

// Not now: called from within a function that the library calls (see Threads), where worlds may not be used, while a step that was begun is
// not waited for, or for messages while too many wait to be sent.
#define DCD_ERR_BUSY (-6)

// Nobody answered in time.
#define DCD_ERR_TIMEOUT (-8)

// The server refuses, or the link to it is gone.
#define DCD_ERR_NETWORK (-9)

// The header that the program was compiled with does not fit the library it runs with, or a snapshot is of another build.
#define DCD_ERR_VERSION (-10)

// The library has a bug. The world that was called can only be destroyed; other worlds go on.
#define DCD_ERR_PANIC (-11)

// The role of this world (see DcdWorldInfo) cannot do this; the message names the role.
#define DCD_ERR_UNSUPPORTED (-12)

// A file cannot be read or written.
#define DCD_ERR_IO (-13)

// The system or the world has no more: threads, ids.
#define DCD_ERR_LIMIT (-14)

// Never. Ground and walls.
#define DCD_FIXED 0

// By forces.
#define DCD_DYNAMIC 1

// At the velocity that you give, whatever it meets. Doors and lifts.
#define DCD_KINEMATIC 2

// To the pose that you give by dcd_body_set_target, whatever it meets. Animated limbs. Not in a served world.
#define DCD_KINEMATIC_POSE 3

// (a + b) / 2.
#define DCD_COMBINE_AVERAGE 0

// The smaller: ice makes everything slippery.
#define DCD_COMBINE_MIN 1

// a * b.
#define DCD_COMBINE_MULTIPLY 2

// The larger: rubber makes everything stick.
#define DCD_COMBINE_MAX 3

// a + b, at most 1.
#define DCD_COMBINE_SUM 4

// The square root of a * b.
#define DCD_COMBINE_GEOMETRIC_MEAN 5

// What the scene says, else DCD_COUPLING_AUTO.
#define DCD_COUPLING_DEFAULT 0

// Copies of a neighbour's bodies push and are not pushed. It gains energy and drops stacks: to compare with.
#define DCD_COUPLING_PROXY 1

// Copies are overwritten by their owner after each step. The cheapest; momentum is not conserved across a border.
#define DCD_COUPLING_OWNER 2

// Bodies near a border live in both regions, each copy with a part of the mass (mass splitting), and take the mean velocity of all
// copies (consensus).
#define DCD_COUPLING_OVERLAP 3

// As DCD_COUPLING_OVERLAP, and a small group of bodies that touch one another moves whole to one region.
#define DCD_COUPLING_ISLAND 4

// As DCD_COUPLING_ISLAND, with as many exchanges at each border as its copies' disagreement asks for.
#define DCD_COUPLING_AUTO 5

// What the scene says, else DCD_PRESET_GAME.
#define DCD_PRESET_DEFAULT 0

// Speed first: 2 exchanges at most, islands of up to 256 bodies whole, 0.1 m/s.
#define DCD_PRESET_DRAFT 1

// What games want: 4 exchanges at most, every island whole, 0.03 m/s.
#define DCD_PRESET_GAME 2

// Accuracy first: 4 exchanges at most, 3 hops deep, every island whole, 0.01 m/s.
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

// Terrain: `rows` x `columns` heights, stretched by `size`, and vertices and triangles of its surface.
#define DCD_SHAPE_HEIGHTFIELD 7

// Several shapes: `parts` of them.
#define DCD_SHAPE_COMPOUND 8

// All below the plane y = 0.
#define DCD_SHAPE_HALF_SPACE 9

// Lines between vertices: triangles of which two corners are one.
#define DCD_SHAPE_LINES 10

// Filled cells of a grid, of edges `size`: vertices and triangles of their surface.
#define DCD_SHAPE_VOXELS 11

// Nothing: the frames stay together. It has no axis of its own.
#define DCD_JOINT_FIXED 0

// Turning about the frames' x axis, as hinges and wheels: DCD_AXIS_TURN_X.
#define DCD_JOINT_REVOLUTE 1

// Sliding along the frames' x axis, as lifts and pistons: DCD_AXIS_X.
#define DCD_JOINT_PRISMATIC 2

// Turning about every axis, as shoulders: DCD_AXIS_TURN_X, _TURN_Y and _TURN_Z, each with the same limit and motor.
#define DCD_JOINT_SPHERICAL 3

// Everything, up to a distance of the frames' origins: a limit of DCD_AXIS_X from 0 to that length, which it needs.
#define DCD_JOINT_ROPE 4

// Everything; a spring pulls the frames' origins to a distance: a motor of DCD_AXIS_X, which it needs. Its position is the
// length at rest; take DCD_MOTOR_FORCE to give stiffness in N/m.
#define DCD_JOINT_SPRING 5

// What DcdJointDef.locked does not lock. It has no axes of its own: dcd_joint_set_limit and dcd_joint_set_motor take any.
#define DCD_JOINT_GENERIC 6

// Along x: metres, m/s, newtons.
#define DCD_AXIS_X 0

// Along y.
#define DCD_AXIS_Y 1

// Along z.
#define DCD_AXIS_Z 2

// About x: radians, rad/s, newton metres.
#define DCD_AXIS_TURN_X 3

// About y.
#define DCD_AXIS_TURN_Y 4

// About z.
#define DCD_AXIS_TURN_Z 5

// Per unit of mass, so that heavy and light bodies move alike: stiffness in 1/s², damping in 1/s.
#define DCD_MOTOR_ACCELERATION 0

// Not per unit of mass: stiffness in N/m or N m/rad, damping in N s/m or N m s/rad.
#define DCD_MOTOR_FORCE 1

// A DcdPose.
#define DCD_FIELD_POSE 0

// A DcdVelocity.
#define DCD_FIELD_VELOCITY 1

// A uint64_t.
#define DCD_FIELD_USER_DATA 2

// A DcdForce, as dcd_body_set_force sets it.
#define DCD_FIELD_FORCE 3

// A DcdPose, as dcd_body_set_target takes it; to be written only.
#define DCD_FIELD_TARGET 4

// Bodies by their shapes, in the colour of the region that owns them, greyed while they sleep; fixed ones are grey, sensors faint.
#define DCD_DRAW_SHAPES 1

// The boxes around movable bodies.
#define DCD_DRAW_AABBS 2

// The boxes around all that movable bodies may reach in the next three steps, by which regions predict contacts across borders.
#define DCD_DRAW_SWEPT_AABBS 4

// Centres of mass, as points.
#define DCD_DRAW_CENTRES_OF_MASS 8

// Regions, as boxes within the bounds of the world.
#define DCD_DRAW_BORDERS 16

// Copies of bodies in regions that do not own them, as boxes in the colour of the region that holds them.
#define DCD_DRAW_GHOSTS 32

// Contacts, as points, with their forces as lines.
#define DCD_DRAW_CONTACTS 64

// Joints, as lines from the one body to the joint and on to the other.
#define DCD_DRAW_JOINTS 128

// Linear velocities, as lines.
#define DCD_DRAW_VELOCITIES 256

// Avatars of clients, as points: white if they are this process's own.
#define DCD_DRAW_AVATARS 512

// Ids of movable bodies, as text.
#define DCD_DRAW_LABELS 1024

// All of it.
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

// All below the plane y = 0.
#define DCD_DRAWN_HALF_SPACE 5

// A mesh of triangles, or of lines, which are triangles of which two corners are one.
#define DCD_DRAWN_MESH 6

// It is new, and has a link.
#define DCD_CONNECTION_CAME 1

// Its link broke. It is waited for: half a minute, as a rule, and as long as the world goes on for a server.
#define DCD_CONNECTION_LOST 2

// It has a link again.
#define DCD_CONNECTION_BACK 3

// It is over, and its id is stale.
#define DCD_CONNECTION_GONE 4

// It is not: it came, or is back.
#define DCD_CAUSE_NONE 0

// It left by itself, or this process did.
#define DCD_CAUSE_LEFT 1

// The server's program sent it away (dcd_disconnect), or this process.
#define DCD_CAUSE_SENT_AWAY 2

// Nothing is heard of it: it was killed, hangs, or is cut off.
#define DCD_CAUSE_BROKEN 3

// One of the two said what it may not, or is not what the other takes it for, as a process of another version.
#define DCD_CAUSE_REFUSED 4

// The world has ended.
#define DCD_CAUSE_WORLD_ENDED 5

// A newer link took its place, or another process with the same identity.
#define DCD_CAUSE_REPLACED 6

// It reads too slowly.
#define DCD_CAUSE_SLOW 7

// What one of the two does for the world does not ask for it any more, as when another node leads.
#define DCD_CAUSE_UNNEEDED 8

// A fault of dcd ended this process's part in the world.
#define DCD_CAUSE_FAILED 9

// They touch and push each other, as without hooks.
#define DCD_MEET_PUSH 0

// They touch, which dcd_events tells, and do not push.
#define DCD_MEET_TOUCH 1

// They pass through each other, and nothing is told.
#define DCD_MEET_NOT 2

// What the scene says, else DCD_FIDELITY_OFF.
#define DCD_FIDELITY_DEFAULT 0

// All of it, in every step.
#define DCD_FIDELITY_OFF 1

// DCD_FIDELITY_TOLERANCE of 0.33 m/s.
#define DCD_FIDELITY_AUTO 2

// What is looked at in full, all else as seldom as keeps the mean error of a body's velocity per step below
// DcdWorldDef.fidelity_limit, m/s. The same on every machine, with any number of threads.
#define DCD_FIDELITY_TOLERANCE 3

// As much as fits into DcdWorldDef.fidelity_limit, milliseconds a step, what is looked at before all else. It depends on the time that
// steps take, so no two runs are the same; a recording keeps what was chosen (dcd_record).
#define DCD_FIDELITY_BUDGET 4

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the version of the library that runs: major * 1000000 + minor * 1000 + patch. The header's own is DCD_VERSION;
// dcd_version_check() compares them.
DCD_API uint32_t dcd_version(void);

// Returns the version as text, as "0.1.0". Lives as long as the program.
DCD_API const char *dcd_version_string(void);

// Returns the name of a status, as "DCD_ERR_NULL"; "(no DCD status)" for other numbers. Lives as long as the program.
DCD_API const char *dcd_status_string(DcdStatus status);

// Returns the name of a reason for a refusal (DcdBodyChange.reason), as "DCD_REFUSED_TOO_FAR"; "(no DCD reason)" for other numbers. Lives as
// long as the program.
DCD_API
const char *dcd_refused_string(uint32_t reason);

// Copies the message of the calling thread's last failed call: the function, the cause, the remedy. At most `cap` bytes
// are written, NUL included; a longer message is cut. Calls that succeed leave the message as it is.
//
// Returns the length of the whole message without NUL, 0 if no call failed yet. `buf` may be null to ask for it.
DCD_API size_t dcd_last_error(char *buf, size_t cap);

// Sends log lines up to the level `most` to `function`, with `user` as its first argument; a null function turns the log
// off. When this returns, the former function is not running and will not be called again.
//
// One function serves the whole process. Errors: DCD_ERR_ARGUMENT for an unknown level, DCD_ERR_BUSY from within the
// callback.
DCD_API DcdStatus dcd_log_set(DcdLogFn function, void *user, DcdLogLevel most);

// Calls `function` where the library finds a bug of its own, an assertion that fails or a panic, on the thread and stack that it happens
// on, before the call that met it returns DCD_ERR_PANIC: to stop in a debugger, or to write a report with a stack trace. Without one, and
// after a null one, a line on stderr tells of it. When this returns, the former function is not running and will not be called
// again.
//
// One function serves the whole process, also for panics of the program's own parts in Rust. Any thread may call it, several at a time. It
// must return normally or end the process (no longjmp, no C++ exception), and calls on worlds from within it give DCD_ERR_BUSY.
// Errors: DCD_ERR_BUSY from within a function that the library calls.
DCD_API
DcdStatus dcd_bug_set(DcdBugFn function,
                      void *context);

// Has all that the library allocates come from these functions, from now to the end of the process: to be called before any other
// function of the library, once.
//
// Any thread may call them, several at a time, also from within every call of the library. They must return normally and call nothing of
// the library. The library must have been built with it: cargo build -p dcd-ffi --release --features allocator.
// Errors: DCD_ERR_NULL (a function), DCD_ERR_BUSY when the library has allocated already, DCD_ERR_UNSUPPORTED without the feature.
DCD_API
DcdStatus dcd_allocator_set(DcdAllocateFn allocate,
                            DcdFreeFn free,
                            void *context);

// Creates an empty local world, which this process computes alone. Destroy it with dcd_world_destroy.
//
// `def` is read during the call. `out` receives the handle.
// Errors: DCD_ERR_NULL, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range, DCD_ERR_LIMIT without threads.
DCD_API DcdStatus dcd_world_create(const DcdWorldDef *def, DcdWorld *out);

// Creates a local world from a scene: a scene of the library ("tower", "pile", "chain" …) or a file, whose
// name ends in .toml, .xml, .mjcf or .urdf. Body i of the scene is dcd_body_at(world, i).
//
// `params` points to `param_count` texts "name=value" that change parameters of the scene, as "n=100"; it may be null when
// there are none. Of `def` only threads, regions, user_data and what follows it count, the scene says the rest; null is
// DCD_WORLD_DEF_INIT. Everything is read during the call.
// Errors: as dcd_world_create; DCD_ERR_ARGUMENT for an unknown scene or parameter or a wrong file, with the line;
// DCD_ERR_IO when the file cannot be read.
DCD_API
DcdStatus dcd_world_open_scene(const char *name_or_path,
                               const char *const *params,
                               size_t param_count,
                               const DcdWorldDef *def,
                               DcdWorld *out);

// Destroys a local world with everything in it, or leaves a served one, whose avatars wait for your return. Its handles
// become stale, and what dcd_state_view and dcd_events lent is freed.
//
// A call that runs on the world in another thread is waited for; calls that wait behind it find the world gone.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice), DCD_ERR_BUSY.
DCD_API DcdStatus dcd_world_destroy(DcdWorld world);

// Returns whether the handle names a world. Never waits.
DCD_API bool dcd_world_is_valid(DcdWorld world);

// Reads the role, tick and settings of a world.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_world_info(DcdWorld world, DcdWorldInfo *out);

// Joins a world that a server holds and nodes compute, as a client, and waits until the server has told the
// whole world, or what is near of it, as it is on its record: up to half a second old (two seconds more where its server has just gone on with a stored world), of tick 0, and without who computes what, until the first states
// have come from the nodes. It need not have nodes yet: the world stands still until it has.
//
// The handle is used like that of a local world; what differs:
// - dcd_body_create makes an avatar, a dynamic or kinematic body of your own. Its id is valid at once and the body stands
//   where you put it; DCD_BODY_APPEARED tells that it is in the world, DCD_BODY_REFUSED that it is not to be, and then its
//   id is stale.
// - dcd_body_set_velocity sets the speed of an avatar, dcd_body_set_pose lets it jump; the next dcd_step sends this input. The
//   server may set a limit to speed and refuse by DCD_BODY_REFUSED.
// - dcd_step takes in what has come since the last, and returns at once: call it as often as dt says. A server that is out of
//   reach is dialled again for half a minute (DcdClientDef.give_up_ms): meanwhile the world goes on as long as nodes compute it, avatars can be
//   moved, and those that are created or destroyed are so once the server is back. After that, or when the world has ended,
//   it returns DCD_ERR_NETWORK, each time; the world can be read still, and must be destroyed.
// - The bodies that are there on joining are not told of: list them once by dcd_bodies, and follow dcd_events from then on.
// - Bodies are where they were when last heard of, some ticks ago; bodies of others can only be read. Contacts are told of
//   your own avatars, if they ask for them.
// - What a client cannot do returns DCD_ERR_UNSUPPORTED: joints, forces and impulses, sleep, dcd_borders, dcd_state_hash, and
//   queries but for those that are submitted (dcd_rays_submit, dcd_shape_casts_submit, dcd_overlap_shapes_submit and the like).
// - dcd_world_destroy leaves in order. Avatars leave with you and come back when you join with the same identity file.
//
// `def` and its texts are read during the call. The library keeps threads of its own until the world is destroyed.
// Errors: DCD_ERR_NULL, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a malformed address or token or a token for another role,
// DCD_ERR_TIMEOUT when nobody answers, DCD_ERR_NETWORK when the server refuses (a used or expired token, another version) or
// cannot be reached, DCD_ERR_IO for the identity file, DCD_ERR_LIMIT without threads.
DCD_API
DcdStatus dcd_client_connect(const DcdClientDef *def,
                             DcdWorld *out);

// Joins as a participant: a client as dcd_client_connect makes it, whose process also computes a share of the world.
//
// The share is computed by threads of the library, whether or not you call dcd_step. dcd_world_destroy first hands it
// to the other nodes, which may take some seconds; a process that ends without it is found dead and replaced.
// Errors: as dcd_client_connect, and DCD_ERR_ARGUMENT for threads out of range.
DCD_API DcdStatus dcd_participant_join(const DcdParticipantDef *def, DcdWorld *out);

// Lists the avatars that this process hosts: those it made, in the world or on their way, and those that an earlier stay
// left behind. These are in the world on joining, and then no DCD_BODY_APPEARED tells of them, or come back soon after it
// (DCD_BODY_APPEARED) where who computed them had not let go of them yet. Into `out`, which has `cap` entries, and their number
// into `count`; with `cap` 0 `out` may be null, to ask for the number. Oldest first. None in a local world.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not).
DCD_API DcdStatus dcd_own_avatars(DcdWorld world, DcdBodyId *out, size_t cap, size_t *count);

// Creates a server: it holds a world, decides which node computes what, and lets clients in. It computes nothing itself; the
// world begins with the nodes that join it (dcd_node_join, dcd_participant_join, or `dcd node` on other machines).
//
// It works on threads of the library, whether or not you call dcd_step, which says whether all is well, and takes in what came
// for your program: of dcd_events, connections and messages. Your program may change the world by the handle: make, move and
// destroy bodies, and tie new ones (dcd_bodies_create, dcd_joint_create); what it did since the last dcd_step is sent with the next,
// is on record before anybody hears of it, and is computed alike by all nodes. Bodies are read from the record: as nodes last told,
// at most half a second ago; to see them move, join the world, also from the same process. What is submitted (dcd_rays_submit and the like)
// the nodes answer, after what your program did before; dcd_events tells of the contacts of all bodies that ask for them, but for
// some while nodes join or leave. dcd_world_destroy ends the world for all, and so does `dcd end`; after dcd_server_suspend, or a process
// that ends without, one that is made in the same way goes on with it. The folder keeps its keys (authority.pem), the list of
// used tokens (joins.log), locks, and the world (world.redb).
//
// `def` and what it points to are read during the call.
// Errors: DCD_ERR_NULL, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range, an unknown scene, or a stored world that
// is another one, DCD_ERR_IO for the scene's file and the folder, also while another server uses it, DCD_ERR_NETWORK when
// an address cannot be listened on, DCD_ERR_LIMIT without threads.
DCD_API
DcdStatus dcd_server_create(const DcdServerDef *def,
                            DcdWorld *out);

// Stops a server without ending its world: what is known of it is written to the data folder, nodes compute on and, as clients
// do, dial a server that is made in the same way, for half a minute. From here on dcd_step fails with DCD_ERR_NETWORK;
// dcd_world_destroy frees the handle.
//
// Errors: DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED for a world that is not a server.
DCD_API DcdStatus dcd_server_suspend(DcdWorld world);

// Mints a token that lets one process join this server as `role`: DCD_ROLE_CLIENT, DCD_ROLE_BUILDER, DCD_ROLE_PARTICIPANT or
// DCD_ROLE_NODE. A builder joins by dcd_client_connect, and may change what is the world's own. The token can be used once, within `valid_seconds` (1 to 31,536,000). Written to `buf` of `cap` bytes with a NUL; `needed` receives the
// size with NUL. With `cap` 0 `buf` may be null, to ask for the size: 512 bytes are always enough, and asking mints none.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for another role or time, DCD_ERR_SMALL_BUFFER, DCD_ERR_IO for the
// server's folder, DCD_ERR_UNSUPPORTED for a world that is not a server.
DCD_API
DcdStatus dcd_token_create(DcdWorld world,
                           DcdRole role,
                           uint32_t valid_seconds,
                           char *buf,
                           size_t cap,
                           size_t *needed);

// Writes the address at which a server or a node listens, as "127.0.0.1:7420": into `buf` of `cap` bytes with a NUL; `needed`
// receives the size with NUL. With `cap` 0 `buf` may be null, to ask for the size.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `needed` is written all the same and `buf` is not),
// DCD_ERR_UNSUPPORTED for a world of another role.
DCD_API DcdStatus dcd_address(DcdWorld world, char *buf, size_t cap, size_t *needed);

// Writes the address at which a server, a node or a participant answers with its metrics, as "127.0.0.1:9420": into `buf` of `cap` bytes with a NUL;
// `needed` receives the size with NUL. With `cap` 0 `buf` may be null, to ask for the size.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `needed` is written all the same and `buf` is not),
// DCD_ERR_UNSUPPORTED for a world that was not told to (`metrics` of its definition).
DCD_API
DcdStatus dcd_metrics_address(DcdWorld world,
                              char *buf,
                              size_t cap,
                              size_t *needed);

// Joins as a node: this process computes a share of the world, on threads of the library, whether or not you call dcd_step,
// which does what it does for a server. Returns once the server has let it in; the share comes when the server gives it one.
// While the server is out of reach the node computes on, and waits for it without end.
//
// The handle serves the calls that a server's does, but for tokens and dcd_disconnect; to see the world too, use dcd_participant_join.
// dcd_world_destroy first hands the share to other nodes, which may take some seconds.
// Errors: as dcd_participant_join, and DCD_ERR_ARGUMENT for a malformed `listen` or `advertise`.
DCD_API
DcdStatus dcd_node_join(const DcdNodeDef *def,
                        DcdWorld *out);

// Makes a box around its origin. `half` has half its edges along x, y, z: metres, at least DCD_MIN_SIZE.
//
// This and the other shape functions copy what they read, and write the new handle to `out`. A shape belongs to its world;
// bodies keep what they need of it, so it may be destroyed before them.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT for a size out of range.
DCD_API DcdStatus dcd_shape_box(DcdWorld world, const float *half, DcdShapeId *out);

// Makes a ball around its origin. Errors: as dcd_shape_box.
DCD_API DcdStatus dcd_shape_sphere(DcdWorld world, float radius, DcdShapeId *out);

// Makes a capsule along y: a cylinder of 2 × `half_height` with a half ball of `radius` at either end. Errors: as
// dcd_shape_box.
DCD_API DcdStatus dcd_shape_capsule(DcdWorld world, float half_height, float radius, DcdShapeId *out);

// Makes a cylinder along y, from -half_height to half_height. Errors: as dcd_shape_box.
DCD_API DcdStatus dcd_shape_cylinder(DcdWorld world, float half_height, float radius, DcdShapeId *out);

// Makes a cone along y: its base of `radius` at -half_height, its tip at half_height. Errors: as dcd_shape_box.
DCD_API DcdStatus dcd_shape_cone(DcdWorld world, float half_height, float radius, DcdShapeId *out);

// Makes the convex hull of `count` points (x, y, z, x, y, z …: 3 × count floats, metres), at least 4, not all in a plane, which reach over
// DCD_MIN_SIZE along each axis.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT for points out of range or that span no volume.
DCD_API
DcdStatus dcd_shape_hull(DcdWorld world,
                         const float *xyz,
                         size_t count,
                         DcdShapeId *out);

// Makes a mesh of `triangle_count` triangles, each three indices below `vertex_count`, counter-clockwise seen from outside;
// 3 × vertex_count floats, 3 × triangle_count indices. Triangles without area are left out. A mesh is hollow, and has mass by density only
// if it is closed: use it for fixed bodies, or give them DcdBodyDef.mass.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT for vertices out of range, no triangle with
// an area, or an index past the vertices.
DCD_API
DcdStatus dcd_shape_mesh(DcdWorld world,
                         const float *xyz,
                         size_t vertex_count,
                         const uint32_t *indices,
                         size_t triangle_count,
                         DcdShapeId *out);

// Makes terrain in the x-z plane around its origin: `rows` heights along z times `columns` along x, metres, at
// heights[row + column * rows]. `scale` stretches it: the whole is scale[0] by scale[2] metres, and heights are times
// scale[1]. Use it for fixed bodies: it has no mass by density.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT for fewer than 2 rows or columns, heights out
// of range, or a scale below DCD_MIN_SIZE.
DCD_API
DcdStatus dcd_shape_heightfield(DcdWorld world,
                                const float *heights,
                                size_t rows,
                                size_t columns,
                                const float *scale,
                                DcdShapeId *out);

// Makes a half space: all behind the plane through its origin that `normal` points away from, without end; of any length above 0. It is
// ground for fixed bodies, in which nothing falls through: it has no mass and no edge.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT for a normal out of range or without length.
DCD_API
DcdStatus dcd_shape_half_space(DcdWorld world,
                               const float *normal,
                               DcdShapeId *out);

// Makes a line from `a` to `b`: a wire, an edge. It has no mass by density: use it for fixed bodies, or give them DcdBodyDef.mass.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world), DCD_ERR_ARGUMENT for points out of range, or nearer to one another than DCD_MIN_SIZE.
DCD_API
DcdStatus dcd_shape_segment(DcdWorld world,
                            const float *a,
                            const float *b,
                            DcdShapeId *out);

// Makes a box, cylinder, cone or hull round: grown by `border` metres on all sides, with edges and corners of that radius (DcdShapeInfo.border).
// What rolls over its edges goes smoothly, and hulls touch at more than a corner.
//
// The other shape may be destroyed afterwards.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT for a border below DCD_MIN_SIZE or out of range, or another kind
// of shape, also one that is round already.
DCD_API
DcdStatus dcd_shape_round(DcdWorld world,
                          DcdShapeId shape,
                          float border,
                          DcdShapeId *out);

// Makes one shape of `count` others, part i at frames[i]. Parts must be simple: no mesh, terrain or compound.
//
// `parts` and `frames` have `count` entries, at least one. The parts may be destroyed afterwards.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or a part), DCD_ERR_ARGUMENT for no part, a part that is not simple or a
// frame that is not finite or no rotation.
DCD_API
DcdStatus dcd_shape_compound(DcdWorld world,
                             const DcdShapeId *parts,
                             const DcdFrame *frames,
                             size_t count,
                             DcdShapeId *out);

// Makes a shape that is another one stretched along its own axes by `scale` (three factors above 0): one mesh or hull in many sizes. What is
// round stays so where the factors let it, else it becomes a hull (of a sphere some hundred points). Parts of a compound that are turned
// can only be stretched alike along all axes. A border (DcdShapeInfo.border) keeps its thickness.
//
// `scale` is read during the call. The other shape may be destroyed afterwards.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT for a factor that is not above 0 or makes the shape too small or
// too large, or a compound that cannot be stretched so.
DCD_API
DcdStatus dcd_shape_scale(DcdWorld world,
                          DcdShapeId shape,
                          const float *scale,
                          DcdShapeId *out);

// Destroys a shape's handle. Bodies made with it keep their shape.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice).
DCD_API DcdStatus dcd_shape_destroy(DcdWorld world, DcdShapeId shape);

// Creates one body, as dcd_bodies_create.
DCD_API DcdStatus dcd_body_create(DcdWorld world, const DcdBodyDef *def, DcdBodyId *out);

// Creates `count` bodies, all or none: `defs` and `out` have `count` entries. Bodies are in the world at once; the next step
// moves them. Those of a client or participant are avatars, and DCD_BODY_APPEARED or DCD_BODY_REFUSED tells what became of each;
// those of a server or a builder are the world's own, of any kind, stay when a builder leaves, and nodes compute them from some ticks
// after the next dcd_step on. A builder is told as a client what became of each.
//
// `defs` is read during the call.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range, more
// than DCD_MAX_ITEMS bodies, a dynamic body without mass or faster than DcdWorldInfo.speed_limit, and of an avatar for a mesh or terrain, DCD_ERR_LIMIT when the world has given 4,294,967,295
// ids, DCD_ERR_UNSUPPORTED for a fixed avatar, one of DCD_KINEMATIC_POSE or with thresholds of sleep, and for a node,
// DCD_ERR_NETWORK when its link is gone.
DCD_API
DcdStatus dcd_bodies_create(DcdWorld world,
                            const DcdBodyDef *defs,
                            size_t count,
                            DcdBodyId *out);

// Destroys `count` bodies with their joints, all or none; contacts they had are told as ended after the next step.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (the world, a body, or a body named twice), DCD_ERR_ARGUMENT for more than
// DCD_MAX_ITEMS, DCD_ERR_UNSUPPORTED for a body of others in a served world.
DCD_API DcdStatus dcd_bodies_destroy(DcdWorld world, const DcdBodyId *bodies, size_t count);

// Destroys one body. As dcd_bodies_destroy.
DCD_API DcdStatus dcd_body_destroy(DcdWorld world, DcdBodyId body);

// Returns whether the id names a body of this world. False too from within a function that the library calls, and once the
// world answers DCD_ERR_PANIC.
DCD_API bool dcd_body_is_valid(DcdWorld world, DcdBodyId body);

// Finds the body that the world numbered `index` when it was made: body i of a scene, or the i-th that was created.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID when that body is destroyed or there is none yet.
DCD_API DcdStatus dcd_body_at(DcdWorld world, uint32_t index, DcdBodyId *out);

// Creates a body, of DCD_KINEMATIC, that is a character: it walks on what it stands on, slides along walls, climbs steps and
// slopes, falls, rides on what moves, and pushes what is in its way. dcd_body_set_velocity says where it wants to go: along the
// ground, and upwards to jump, which it can from the ground; with a gravity_scale of 0 it flies as it wants and collides all the
// same. dcd_body_get tells how it moves. Its shape is one that has volume; dcd_collider_add gives it others that only meet what
// comes.
//
// In a served world it is walked by the node that computes it, also that of a client: it stops at a wall without a delay, and
// its client cannot put it elsewhere (dcd_body_set_pose). A client may have 32 characters and vehicles together; its characters take steps (step_height, step_depth, snap) of at most 1 m, keep a gap of at most 0.1 m, and weigh at most 10,000 kg.
// Errors: as dcd_bodies_create, and DCD_ERR_ARGUMENT for another body_type, a sensor, or a setting out of range.
DCD_API
DcdStatus dcd_character_create(DcdWorld world,
                               const DcdBodyDef *body,
                               const DcdCharacterDef *character,
                               DcdBodyId *out);

// Creates a body, of DCD_DYNAMIC, that is a vehicle: its chassis stands on wheels, each a ray along its suspension to the nearest
// collider that the chassis may collide with. dcd_vehicle_drive says what its driver does. What it stands on feels nothing of it.
//
// In a served world it is driven by the node that computes it, also that of a client, without a delay between wheels and ground. A
// client's is bounded: 8 wheels within 10 m, a top_speed of at most the world's avatar_speed, suspensions that together speed it up by at
// most 200 m/s² (stiffness x travel) and are damped by at most 60 1/s. One above 1e9 kg, or at more than 1e5 m/s, has no wheels.
// Errors: as dcd_bodies_create, and DCD_ERR_ARGUMENT for another body_type or a setting out of range.
DCD_API
DcdStatus dcd_vehicle_create(DcdWorld world,
                             const DcdBodyDef *body,
                             const DcdVehicleDef *vehicle,
                             DcdBodyId *out);

// Says what the driver of a vehicle does from now on, and wakes it: an avatar of this process, or any of a local world or a server.
// In a served world the next dcd_step asks for it.
//
// Errors: DCD_ERR_UNSUPPORTED for a body that this process may not drive, DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for
// numbers out of range or a body that is no vehicle.
DCD_API
DcdStatus dcd_vehicle_drive(DcdWorld world,
                            DcdBodyId vehicle,
                            const DcdDrive *drive);

// Reads the type, mass, owner, forces and sleep of a body.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_body_info(DcdWorld world, DcdBodyId body, DcdBodyInfo *out);

// Reads the pose and velocity of a body. `pose` or `velocity` may be null. For many bodies see dcd_state_view and
// dcd_state_read. A client or participant reads what it was last told, every DcdServerDef.state_every steps; to draw see
// dcd_view_body.
//
// Errors: DCD_ERR_NULL (world, body), DCD_ERR_STALE_ID.
DCD_API DcdStatus dcd_body_get(DcdWorld world, DcdBodyId body, DcdPose *pose, DcdVelocity *velocity);

// Interpolates between two poses, for drawing between steps: `t` = 0 is `from`, 1 is `to`. Positions go straight, rotations by SLERP
// the shorter way. `from`, `to` and `out` may be the same. Needs no world; may run beside any other call.
//
// Errors: DCD_ERR_NULL, DCD_ERR_ARGUMENT for a `t` that is not finite, a pose out of range or a q that is not of length 1.
DCD_API
DcdStatus dcd_pose_interpolate(const DcdPose *from,
                               const DcdPose *to,
                               double t,
                               DcdPose *out);

// Teleports a body to a pose, whatever is there, and wakes it. A fixed body of a local world may be moved so too. A client
// or participant moves its own avatars but characters, a server all but fixed bodies; the next dcd_step asks for it. In a local
// world the body keeps its velocity; in a served one it gets that which this process last heard of (dcd_body_get), up to half a second
// old, or that which is set in the same step.
//
// Errors: DCD_ERR_UNSUPPORTED for a body that this process may not move, DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a
// pose out of range or whose q is not of length 1.
DCD_API
DcdStatus dcd_body_set_pose(DcdWorld world,
                            DcdBodyId body,
                            const DcdPose *pose);

// Sets the velocity of a dynamic or kinematic body, and wakes it. A client or participant drives its own avatars, a server all
// bodies; the next dcd_step asks for it.
//
// Errors: DCD_ERR_UNSUPPORTED for a body that this process may not drive, DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for
// numbers out of range, a dynamic body above DcdWorldInfo.speed_limit, a fixed body or one that follows poses.
DCD_API DcdStatus dcd_body_set_velocity(DcdWorld world, DcdBodyId body, const DcdVelocity *velocity);

// Sets the kinematic target of a body of type DCD_KINEMATIC_POSE: the pose that it has after the next step. What it touches feels the
// speed that this takes. It stays there until it gets another. For many bodies see dcd_state_write.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for another type, a pose out of range or whose q is not of length 1, or
// so far off that it would be faster than DCD_MAX_NUMBER; DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_body_set_target(DcdWorld world,
                              DcdBodyId body,
                              const DcdPose *pose);

// Wakes a body. Bodies wake by themselves when something that moves touches them.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED in a served world but for its server and builders, which wake movable bodies.
DCD_API
DcdStatus dcd_body_wake(DcdWorld world,
                        DcdBodyId body);

// Puts a body to sleep: it stops, and costs nothing until something wakes it.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED in a served world.
DCD_API DcdStatus dcd_body_sleep(DcdWorld world, DcdBodyId body);

// Applies an impulse to a dynamic body, and wakes it: `impulse` in N s, world axes, at `point` in world space, metres; a null `point`
// is the centre of mass.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a body that is not dynamic, or that would be
// faster than DCD_MAX_NUMBER; forces and impulses themselves may be larger. DCD_ERR_UNSUPPORTED for clients,
// participants and nodes.
DCD_API
DcdStatus dcd_body_apply_impulse(DcdWorld world,
                                 DcdBodyId body,
                                 const float *impulse,
                                 const double *point);

// Applies an angular impulse to a dynamic body, and wakes it: `impulse` in N m s, world axes. Errors: as dcd_body_apply_impulse.
DCD_API DcdStatus dcd_body_apply_torque_impulse(DcdWorld world, DcdBodyId body, const float *impulse);

// Sets the force and torque on a dynamic body in every step from now on, and wakes it: `force` in N at its centre of mass and `torque`
// in N m, world axes; null is none. Set both to none to stop. A later call replaces what an earlier one set.
//
// Errors: as dcd_body_apply_impulse.
DCD_API
DcdStatus dcd_body_set_force(DcdWorld world,
                             DcdBodyId body,
                             const float *force,
                             const float *torque);

// Adds a force to that of dcd_body_set_force: `force` in N, world axes, at `point` in world space, metres; a null `point` is the centre
// of mass. Its torque is computed now and stays when the body moves on: for a thruster, set no force and add those of all
// thrusters before each step.
//
// Errors: as dcd_body_apply_impulse, and DCD_ERR_UNSUPPORTED for servers and builders too, which set the whole force (dcd_body_set_force).
DCD_API
DcdStatus dcd_body_add_force(DcdWorld world,
                             DcdBodyId body,
                             const float *force,
                             const double *point);

// Pushes all dynamic bodies near a place away from it, once and at once, and wakes them; writes their number into `pushed`, which may be null.
// Each of their colliders near it that is no sensor is pushed at its nearest point, away from the centre, by its silhouette: of two
// bodies of one size the lighter flies off faster. Walls give no shelter: cast rays to know of them. No body becomes faster by it than the world's speed limit.
//
// `explosion` is read during the call.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range (then nothing is pushed),
// DCD_ERR_UNSUPPORTED in a served world: its server finds bodies by dcd_overlap_shapes_submit and pushes them.
DCD_API
DcdStatus dcd_explode(DcdWorld world,
                      const DcdExplosion *explosion,
                      size_t *pushed);

// Pushes the dynamic bodies that are in a fluid as it does in one step, and wakes them: call it before each dcd_step, for each lake and each
// wind. Writes their number into `pushed`, which may be null.
//
// What is in it is each collider that is no sensor and whose box (AABB) touches that of the fluid, and of that what lies below the surface. It is lifted by the weight of the fluid that it
// displaces, at the centre of that volume, and dragged, at the centre of mass, by 1/2 density drag A v², by the silhouette A against the motion v through the fluid. Each face that is turned to it, with a shadow A, is pressed by
// 1/2 density lift A v² against its normal, of which counts what is across the flow: sails and leaves are lifted. Besides, motion and spin
// die down by `damping` times the mass displaced over the body's own. Neither ever turns a motion about. Lift comes at once and weight over the
// step, so that between two steps what floats at rest has a velocity of up to half of gravity times dt downwards, and does not move. Terrain and open meshes displace nothing
// and are left alone; of round shapes the border does not count, as it does not for their mass.
//
// `fluid` is read during the call.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range or a min above its max (then nothing is
// pushed), DCD_ERR_UNSUPPORTED in a served world: its server finds bodies by dcd_overlap_boxes_submit and pushes them.
DCD_API
DcdStatus dcd_flow(DcdWorld world,
                   const DcdFluid *fluid,
                   size_t *pushed);

// Lists the movable bodies that overlap a sensor as the world is now, by age, into `out`, which has `cap` entries, and their number into `count`:
// asleep or not, whichever region they are in, also when they were made or moved since the last step. `collider` says which one of `body` is
// the sensor, from 0. Groups and masks of both count; other sensors and fixed bodies are not listed, and no events need be asked for. With `cap` 0 `out` may be null, to ask for the
// number. Who comes and goes is told by dcd_events.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a collider that is not there or is no sensor, DCD_ERR_SMALL_BUFFER (then
// `count` is written all the same and `out` is not), DCD_ERR_UNSUPPORTED in a served world.
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
// as it is; if anything but user_data was changed, the body wakes. A body that becomes fixed, or movable, loses the memory
// of its contacts.
//
// `properties` is read during the call.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range, to fix a link of a
// multibody, or where a dynamic body would have no mass; DCD_ERR_UNSUPPORTED in a served world but for its server and builders, which change movable bodies and let them be movable.
DCD_API
DcdStatus dcd_body_set_properties(DcdWorld world,
                                  DcdBodyId body,
                                  const DcdBodyProperties *properties);

// Reads the properties of one collider of a body. `collider` is its number, from 0.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a collider that is not there.
DCD_API
DcdStatus dcd_collider_properties(DcdWorld world,
                                  DcdBodyId body,
                                  uint32_t collider,
                                  DcdColliderProperties *out);

// Changes the properties of one collider of a body: read them by dcd_collider_properties, change members, and give them back. What is
// as it was stays as it is.
//
// `properties` is read during the call.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a collider that is not there or a member out of
// range, DCD_ERR_UNSUPPORTED in a served world but for its server and builders, which change movable bodies.
DCD_API
DcdStatus dcd_collider_set_properties(DcdWorld world,
                                      DcdBodyId body,
                                      uint32_t collider,
                                      const DcdColliderProperties *properties);

// Adds a collider to a body, as the last of its colliders; its number goes to `out`, which may be null. The contacts of the body
// begin anew, without memory.
//
// `properties` is read during the call; null is DCD_COLLIDER_PROPERTIES_INIT.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world, body or shape), DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range or
// more than DCD_MAX_COLLIDERS, DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_collider_add(DcdWorld world,
                           DcdBodyId body,
                           DcdShapeId shape,
                           const DcdColliderProperties *properties,
                           uint32_t *out);

// Removes a collider from a body; the numbers of those after it move down by one. The contacts of the body begin anew, without
// memory.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a collider that is not there or is the only one,
// DCD_ERR_UNSUPPORTED in a served world.
DCD_API DcdStatus dcd_collider_remove(DcdWorld world, DcdBodyId body, uint32_t collider);

// Gives a collider of a body another shape. The contacts of the body begin anew, without memory.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world, body or shape), DCD_ERR_ARGUMENT for a collider that is not there,
// DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_collider_set_shape(DcdWorld world,
                                 DcdBodyId body,
                                 uint32_t collider,
                                 DcdShapeId shape);

// Sets what dcd_events tells of a body, as DcdBodyDef.events and force_threshold do when it is made: DCD_EVENT_… bits and
// newtons. `collider` is the number of one of its colliders, from 0, or DCD_ALL_COLLIDERS.
//
// Of a contact that is there already, the end is told only if the beginning was; where none of its two colliders is to tell of it
// any more, with the next step.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a collider that is not there, unknown bits or a threshold below 0,
// DCD_ERR_UNSUPPORTED in a served world but for its server and builders, which change movable bodies.
DCD_API
DcdStatus dcd_body_set_events(DcdWorld world,
                              DcdBodyId body,
                              uint32_t collider,
                              uint32_t events,
                              float force_threshold);

// Sets how a body slides and bounces: Coulomb coefficient, 0 or more, and restitution, 0 to 1. `collider` as in
// dcd_body_set_events.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a collider that is not there or a coefficient out of range,
// DCD_ERR_UNSUPPORTED in a served world but for its server and builders, which change movable bodies.
DCD_API
DcdStatus dcd_body_set_material(DcdWorld world,
                                DcdBodyId body,
                                uint32_t collider,
                                float friction,
                                float restitution);

// Sets which groups a body belongs to and which it meets, as DcdBodyDef.groups and mask do. `collider` as in
// dcd_body_set_events.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a collider that is not there, DCD_ERR_UNSUPPORTED in a served
// world but for its server and builders, which change movable bodies.
DCD_API
DcdStatus dcd_body_set_groups(DcdWorld world,
                              DcdBodyId body,
                              uint32_t collider,
                              uint32_t groups,
                              uint32_t mask);

// Reads what a shape is, one that you made or found.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_shape_info(DcdWorld world, DcdShapeId shape, DcdShapeInfo *out);

// Reads the vertices of a hull, mesh, terrain, lines or voxels, 3 x `cap` floats at most, and their number into `count`. With `cap` 0 `xyz` may be
// null, to ask for the number.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `xyz` is
// not).
DCD_API
DcdStatus dcd_shape_vertices(DcdWorld world,
                             DcdShapeId shape,
                             float *xyz,
                             size_t cap,
                             size_t *count);

// Reads the triangles of a hull, mesh, terrain, lines or voxels, 3 x `cap` indices of vertices at most, and their number into `count`:
// counterclockwise seen from outside. With `cap` 0 `indices` may be null, to ask for the number.
//
// Errors: as dcd_shape_vertices.
DCD_API
DcdStatus dcd_shape_triangles(DcdWorld world,
                              DcdShapeId shape,
                              uint32_t *indices,
                              size_t cap,
                              size_t *count);

// Reads the heights of terrain as dcd_shape_heightfield takes them, `cap` at most, and their number into `count`: 0 of other
// shapes. With `cap` 0 `heights` may be null, to ask for the number.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_SMALL_BUFFER (then `count` is written all the same and
// `heights` is not).
DCD_API DcdStatus dcd_shape_heights(DcdWorld world, DcdShapeId shape, float *heights, size_t cap, size_t *count);

// Lists all bodies into `out`, which has `cap` entries, and their number into `count`: fixed ones too, in the order in which they were
// made; in a served world those that this process has heard of: first those of the scene and the server's program, then avatars,
// client by client, then what builders have built. With `cap` 0 `out` may be null, to ask for the number.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not),
// DCD_ERR_UNSUPPORTED for a node.
DCD_API
DcdStatus dcd_bodies(DcdWorld world,
                     DcdBodyId *out,
                     size_t cap,
                     size_t *count);

// Reads how large and heavy a body is as it is now. It follows from its shapes and properties, so that in a served world it is known of every
// body that this process has heard of. It takes some microseconds, of a body of many vertices more.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED for a node.
DCD_API
DcdStatus dcd_body_extent(DcdWorld world,
                          DcdBodyId body,
                          DcdBodyExtent *out);

// Finds the shape of one collider of a body, of any body that this process knows. `collider` is its number, from 0;
// dcd_collider_properties says where it sits on the body.
//
// Equal shapes have one handle, so that what a renderer makes of it can be kept by it; that of the shape function with which you made
// it is another. It need not be destroyed; once it is, this gives a new one.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a collider that is not there, DCD_ERR_UNSUPPORTED for a node.
DCD_API
DcdStatus dcd_collider_shape(DcdWorld world,
                             DcdBodyId body,
                             uint32_t collider,
                             DcdShapeId *out);

// Finds one of the shapes that a compound is made of, from 0 on, as dcd_collider_shape does, and where it is in the compound.
// `frame` may be null.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_ARGUMENT for a part that is not there.
DCD_API
DcdStatus dcd_shape_part(DcdWorld world,
                         DcdShapeId shape,
                         uint32_t part,
                         DcdShapeId *out,
                         DcdFrame *frame);

// Creates a joint between two bodies of a local world, or of a server's own: those that it made since its last dcd_step, or one of
// them and a fixed one. Clients that may not build, and nodes, have no joints (DCD_ERR_UNSUPPORTED); a server and builders may drive and destroy any. What
// joints tie together is owned and moved whole by one region, so keep it small against a region.
//
// `def` is read during the call. Both bodies wake. The joint is gone when either body is destroyed.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or a body), DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range, a
// limit or motor of a joint without an axis of its own, or twice the same body.
DCD_API
DcdStatus dcd_joint_create(DcdWorld world,
                           const DcdJointDef *def,
                           DcdJointId *out);

// Destroys a joint and wakes its bodies.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice, or when one of its bodies was destroyed).
DCD_API DcdStatus dcd_joint_destroy(DcdWorld world, DcdJointId joint);

// Returns whether the id names a joint of this world. False too from within a function that the library calls, and once the
// world answers DCD_ERR_PANIC.
DCD_API bool dcd_joint_is_valid(DcdWorld world, DcdJointId joint);

// Reads the state of a joint: what it ties, where it stands, what it bears.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_joint_info(DcdWorld world, DcdJointId joint, DcdJointInfo *out);

// Limits one axis of a joint, and wakes its bodies: `limit` points to the lowest and the highest position, metres or radians;
// -INFINITY and INFINITY leave a side open. Null takes the limit away. Coupled axes have one limit, a rope's is DCD_AXIS_X;
// where it is a distance its lowest is 0.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for numbers out of range, a lowest above the highest, or an axis that
// is locked or none.
DCD_API DcdStatus dcd_joint_set_limit(DcdWorld world, DcdJointId joint, DcdJointAxis axis, const float *limit);

// Sets the motor of one axis of a joint, and wakes its bodies. Null stops the motor: the axis is free again. Coupled axes have
// one motor, a spring's is DCD_AXIS_X.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for numbers out of range, an unknown model, an axis that is locked or
// none, or coupled axes about which it would turn.
DCD_API
DcdStatus dcd_joint_set_motor(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              const DcdJointMotor *motor);

// Reads the limit of one axis: lowest and highest into `out`, which has two entries; -INFINITY to INFINITY where there is
// none.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for an axis that is locked or none.
DCD_API DcdStatus dcd_joint_get_limit(DcdWorld world, DcdJointId joint, DcdJointAxis axis, float *out);

// Reads the motor of one axis; all is 0 where none runs.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for an axis that is locked or none.
DCD_API
DcdStatus dcd_joint_get_motor(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              DcdJointMotor *out);

// Moves a joint on its bodies, and wakes them: where it sits on `a` and on `b`. A null frame stays as it is.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a frame that is not finite or no rotation.
DCD_API
DcdStatus dcd_joint_set_frames(DcdWorld world,
                               DcdJointId joint,
                               const DcdFrame *frame_a,
                               const DcdFrame *frame_b);

// Sets whether a joint acts and whether its bodies collide with one another, and wakes them: DCD_JOINT_COLLIDE and
// DCD_JOINT_DISABLED bits.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for other bits.
DCD_API DcdStatus dcd_joint_set_flags(DcdWorld world, DcdJointId joint, uint32_t flags);

// Sets how stiffly a joint holds what it locks and limits, as in DcdJointDef, and wakes its bodies.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for numbers out of range.
DCD_API
DcdStatus dcd_joint_set_softness(DcdWorld world,
                                 DcdJointId joint,
                                 float natural_frequency,
                                 float damping_ratio);

// Lists the joints of a body into `out`, which has `cap` entries, and their number into `count`. With `cap` 0 `out` may be
// null, to ask for the number. Oldest first.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not).
DCD_API
DcdStatus dcd_body_joints(DcdWorld world,
                          DcdBodyId body,
                          DcdJointId *out,
                          size_t cap,
                          size_t *count);

// Sets how much the locked axes of a joint bear: newtons and newton metres, 0 or more, INFINITY for any load, as at first. After each dcd_step in
// which it bears more, DcdEventView.overloads tells of it; it stays as it is until you destroy it. It is saved with the world.
//
// The load is that of the whole joint, however many regions share it. It is the solver's: of its last iteration, without the forces of limits and
// motors. A load that lasts shows; of a blow, only what its last iteration had left to bear. Its torque is
// not that about the anchor, unless this is the body's centre of mass: go by the force.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or joint), DCD_ERR_ARGUMENT for numbers below 0 or NaN, DCD_ERR_UNSUPPORTED in a
// served world.
DCD_API
DcdStatus dcd_joint_strength_set(DcdWorld world,
                                 DcdJointId joint,
                                 float force,
                                 float torque);

// Advances the world by one step of its own length, DcdWorldInfo.dt; call it as often as your clock says. The length is the
// world's and not an argument, since every process that computes the world must use the same.
//
// A served world advances by itself: there the call sends what was asked of avatars, takes in what has come since the last
// call, and returns without waiting for anything.
//
// What dcd_state_view lent two steps ago is overwritten. Other calls on the world wait until the step is done; views lent
// before may be read meanwhile.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_BUSY, DCD_ERR_PANIC, DCD_ERR_NETWORK once the link to the server is gone or
// the world has ended (the last state stays readable, and what came before the loss is in dcd_events), DCD_ERR_IO once a server
// could not write its folder, and has stopped, or once its world has ended and its recording is not whole. Each later step says
// so again; what is known can still be read.
DCD_API DcdStatus dcd_step(DcdWorld world);

// Begins what dcd_step does, on a thread of the library, and returns at once; dcd_step_wait says what became of it. Meanwhile
// draw what dcd_state_view lent, which stays as it is until the step after this one. Every other call on the world waits until
// the step is done, and then sees what it made.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_BUSY when a step was begun and dcd_step_wait has not told of it yet,
// DCD_ERR_LIMIT without a thread.
DCD_API DcdStatus dcd_step_begin(DcdWorld world);

// Waits until the step that dcd_step_begin began is done, but not longer than `timeout_ns` nanoseconds: 0 only looks, DCD_FOREVER
// has no limit. Returns what dcd_step would have, once for each step that was begun.
//
// Errors: DCD_ERR_TIMEOUT while it is not done, DCD_ERR_ARGUMENT when none was begun, and those of dcd_step.
DCD_API DcdStatus dcd_step_wait(DcdWorld world, uint64_t timeout_ns);

// Has the program's own threads compute a local world from the next dcd_step on, instead of threads of the library's, which end; null
// goes back to these. `tasks` is read during the call; its functions and `context` must be there until others are set or the world is
// destroyed.
//
// A step that is worth it (some hundred awake bodies) starts DcdWorldDef.threads tasks and waits a tenth of a millisecond for them to begin.
// Those that have share the work; with none the calling thread does it alone, so that no step waits for a thread that is busy
// elsewhere. The calling thread waits meanwhile: it is best none of the job system's own. Every task is finished before dcd_step returns, those
// that came too late too. The same holds for a call with many queries. The result does not depend on any of it.
//
// Both functions are called by the thread that calls dcd_step, by one of the library's after dcd_step_begin, and by each thread that asks
// many queries, by several at a time where several ask. They must return normally (no longjmp, no C++ exception), and calls on worlds from
// within them give DCD_ERR_BUSY: so a thread that helps others while it waits must not take on a job that calls the library.
// They are not saved with the world.
// Errors: DCD_ERR_NULL (world, a function), DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT, DCD_ERR_LIMIT when the system gives no
// threads to go back to, DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_tasks_set(DcdWorld world,
                        const DcdTasks *tasks);

// Reads how a world is stepped; a node is told by its server.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED for a node.
DCD_API DcdStatus dcd_settings(DcdWorld world, DcdSettings *out);

// Changes how a world is stepped, from the next dcd_step on: read it by dcd_settings, change members, and give it back. Bodies that sleep are
// woken if gravity changes. It is saved with the world. A served world keeps the settings with which its server was made, and is stepped
// by Rapier's own parameters: of a world that is to be a server's source, change only gravity, dt, solver_iterations, tolerance and
// speed_limit.
//
// `settings` is read during the call.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for a member out of range (then nothing is changed),
// DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_settings_set(DcdWorld world,
                           const DcdSettings *settings);

// Changes gravity, m/s², as dcd_settings_set does.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for numbers out of range, DCD_ERR_UNSUPPORTED in a served world.
DCD_API DcdStatus dcd_gravity_set(DcdWorld world, const float *gravity);

// Lends the state of every movable body as arrays, without copying: as it was after the last step. What was made or changed
// since shows after the next one; before the first step (and in the first call of all) it shows the present. A client or participant is
// told states every DcdServerDef.state_every steps: to draw the steps between see dcd_view_state.
//
// The arrays are the library's: do not write or free them. They keep their content until the step after next begins; then
// they are overwritten, and the memory stays readable until the world is destroyed. So another thread may read them while
// this one makes one step. To go back (dcd_checkpoint_restore, dcd_snapshot_load) counts as a step; before the first step every call overwrites them. The first call makes every later dcd_step fill the arrays, some 30 ns a body.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED for a node.
DCD_API
DcdStatus dcd_state_view(DcdWorld world,
                         DcdStateView *out);

// Copies one field of `count` bodies into your memory, as it is now: that of bodies[i] goes to
// (char *)dst + i * stride. `stride` in bytes is at least the field's size; 0 is exactly that. `dst` needs no alignment.
//
// With `each` null the first bad body fails the call and nothing is written. Else `each` has `count` entries that receive
// DCD_OK or what is wrong with that body, only good bodies are written, and the call is DCD_OK; dcd_last_error() tells of the
// last bad one.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for an unknown field, a short stride, or more than DCD_MAX_ITEMS.
DCD_API
DcdStatus dcd_state_read(DcdWorld world,
                         const DcdBodyId *bodies,
                         size_t count,
                         DcdField field,
                         void *dst,
                         size_t stride,
                         DcdStatus *each);

// Sets one field of `count` bodies from your memory, laid out as for dcd_state_read. It does what dcd_body_set_pose,
// dcd_body_set_velocity, dcd_body_set_force and dcd_body_set_target do.
//
// With `each` null the first bad body or value fails the call; the bodies before it are changed already, unless the id was
// bad: ids are checked first. Else `each` has `count` entries that receive DCD_OK or what is wrong with that body, and the
// call is DCD_OK.
// Errors: as dcd_state_read, and those of the single calls.
DCD_API
DcdStatus dcd_state_write(DcdWorld world,
                          const DcdBodyId *bodies,
                          size_t count,
                          DcdField field,
                          const void *src,
                          size_t stride,
                          DcdStatus *each);

// Returns the ticks to show now. Call it once per frame, from whatever thread.
//
// In a served world states come some times per second, late, unevenly, and not all of them: `shown` is as little behind the world as
// that allows, and goes forward evenly. From the first call on a client pings the node that tells it of the world, and keeps the
// states that it was told last. In a local world `shown` goes from one step to the next as time goes by since the last dcd_step, and
// from the first call on steps keep how awake bodies were before, some 50 ns each. A server shows its world as it was heard of last.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED for a node.
DCD_API
DcdStatus dcd_view_time(DcdWorld world,
                        DcdViewTime *out);

// Reads how a body is shown at a tick: where it is, and how it moves. `pose` or `velocity` may be null.
//
// Between known states positions follow cubic Hermite splines, or two straight lines where the velocities tell of an impact; rotations
// follow SLERP. Beyond the last state the body goes on and comes to a stop within a quarter of a second. Where a later state
// contradicts what was shown at the last dcd_view_time, the difference melts away within 0.2 s, and 0.1 s more per metre (above 3 m it
// jumps). Before the first dcd_view_time, and for a server, it is what dcd_body_get returns.
// Errors: DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a tick that is no finite number.
DCD_API
DcdStatus dcd_view_body(DcdWorld world,
                        DcdBodyId body,
                        double tick,
                        DcdPose *pose,
                        DcdVelocity *velocity);

// Lends every movable body as it is shown, as dcd_state_view lends them as they are: own avatars, with what they touch, at
// time->predicted, all others at time->shown; what comes near goes from the one to the other within a second. Set both to
// the same where an own avatar is to be shown with the others. `tick` of the view is that of the newest state.
//
// The arrays are the library's: do not write or free them. They keep their content until the next dcd_view_state of this world; the
// memory stays readable until the world is destroyed.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for ticks that are no finite numbers, DCD_ERR_UNSUPPORTED
// for a node.
DCD_API
DcdStatus dcd_view_state(DcdWorld world,
                         const DcdViewTime *time,
                         DcdStateView *out);

// Draws a world by calls of the functions of `draw`: in a frame, at the time that it shows (dcd_view_time), or, where `time` is null, as it
// is after the last dcd_step. Boxes around bodies, centres of mass, ghosts and contacts are always of the last step.
//
// A local world draws everything. A client or participant draws what it is told: shapes, borders, velocities, avatars, labels; a server, whose
// record is half a second old, joints too. The rest is known only to who computes it, and left out.
//
// The functions are called by the calling thread, before this returns. They must return normally (no longjmp, no C++ exception). The
// world is theirs meanwhile: calls of other threads on it wait, and every call on a world from within is DCD_ERR_BUSY.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for unknown flags, a `min` that is above its `max`, NaN in them, and scales that are
// not finite (corners may be infinite), DCD_ERR_BUSY from within a callback, DCD_ERR_UNSUPPORTED for a node.
DCD_API
DcdStatus dcd_debug_draw(DcdWorld world,
                         const DcdViewTime *time,
                         const DcdDebugDraw *draw);

// Writes the world as it is after the last step to a binary glTF file (.glb), for Blender and engines: bodies as nodes named by their numbers ("b7",
// "c2/b0"), with their shapes in the colour of the region that owns them. What is at `path` is replaced.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_LIMIT for a file above 4 GiB, DCD_ERR_UNSUPPORTED for a node.
DCD_API
DcdStatus dcd_gltf_save_file(DcdWorld world,
                             const char *path);

// Sets whether a client or participant shows its own avatars, and what they touch, ahead of the world, so that they answer at once; it
// does at first.
//
// Once dcd_view_time was called, a client keeps a small world of what is within some metres of its avatars. What you ask of them acts there
// in the same frame, and names the step for which it is meant (DcdViewTime.predicted), so that nodes do it in just that one. Where states
// that come are not as predicted, what follows is computed again, and the difference melts away as dcd_view_body says. At most 64
// bodies are predicted, with what joints tie to them, for at most a second and a half; assemblies with multibodies are not, nor is anything in a
// world whose steps are not paced. A local world has nothing to predict.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED for a server or a node.
DCD_API
DcdStatus dcd_prediction_set(DcdWorld world,
                             bool predicts);

// Reads what a client predicts, and how often it was wrong; all 0 where nothing is predicted.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_prediction(DcdWorld world, DcdPrediction *out);

// Lists the connections of a world into `out`, which has `cap` entries, the oldest first, and their number into `count`. With
// `cap` 0 `out` may be null, to ask for the number. A server has one with each node, client and participant; others have one
// with their server, and those with nodes and clients that their share of the world, or their avatars, ask for. A local world
// has none.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not).
DCD_API DcdStatus dcd_connections(DcdWorld world, DcdConnectionId *out, size_t cap, size_t *count);

// Reads the state and figures of a connection.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, also once it is gone, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_connection_info(DcdWorld world, DcdConnectionId connection, DcdConnectionInfo *out);

// Disconnects a process from a server's world. It is told `reason`, a text shorter than DCD_MAX_REASON, or null for none; a node's
// regions are handed over first, a client's avatars wait for its return, which takes a new token. Returns at once;
// DCD_CONNECTION_GONE tells when it is gone, and there its dcd_step says DCD_ERR_NETWORK with the reason.
//
// To leave a world, call dcd_world_destroy.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a reason that is too long, DCD_ERR_UNSUPPORTED for a world that
// is not a server.
DCD_API
DcdStatus dcd_disconnect(DcdWorld world,
                         DcdConnectionId connection,
                         const char *reason);

// Waits until something has come that the next dcd_step would take in: states and events of a client's world, messages,
// changes of connections, the end of the world; not longer than `timeout_ms` milliseconds, and not at all in a local world.
// Once the world has ended or the server is given up it returns at once: dcd_step says why. Other calls on the world do not wait
// for this one.
//
// Errors: DCD_ERR_TIMEOUT when nothing has come, DCD_ERR_NULL, DCD_ERR_STALE_ID.
DCD_API DcdStatus dcd_poll(DcdWorld world, uint32_t timeout_ms);

// Sends `size` bytes to the program at the other end of a connection, where they are among the messages of dcd_events after
// its next dcd_step. A server's program speaks with that of every node, client and participant, and those with the server's only:
// what one client has to say to another passes through the server's program.
//
// A message, with `flags` 0, arrives once and in order, as long as the link lasts; it has DCD_MAX_MESSAGE bytes at most. With
// DCD_SEND_UNRELIABLE it is a datagram of DCD_MAX_DATAGRAM bytes at most, which may be lost or overtaken, and never waits.
// Messages on their way when a link breaks (DCD_CONNECTION_LOST) are lost.
//
// The world never waits for messages. A program that makes no steps takes none: then up to 128 KiB wait there and as much
// here, counting 64 bytes more for each, and then the call is DCD_ERR_BUSY. Of datagrams the newest are dropped where 64 KiB
// wait, and counted (DcdConnectionInfo.dropped).
//
// The call copies the bytes and returns at once. `data` may be null when `size` is 0.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for too many bytes or unknown flags, DCD_ERR_BUSY when too much waits
// already, DCD_ERR_NETWORK while the connection is lost, DCD_ERR_UNSUPPORTED in a local world, and when neither end is a server.
DCD_API
DcdStatus dcd_send(DcdWorld world,
                   DcdConnectionId connection,
                   const void *data,
                   size_t size,
                   uint32_t flags);

// Lends the events of the last step; nothing before the first. Poll it once a step: a step without a look loses its
// events, and the messages that came.
//
// The arrays are the library's, and live as those of dcd_state_view do.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_events(DcdWorld world, DcdEventView *out);

// Lists the points at which a body touches others as they are after the last step, into `out`, which has `cap` entries, and their
// number into `count`: by pairs of colliders and manifolds. Sensors have none, dcd_events and dcd_overlap_shapes tell of them. With
// `cap` 0 `out` may be null, to ask for the number.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not),
// DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_body_contacts(DcdWorld world,
                            DcdBodyId body,
                            DcdContactPoint *out,
                            size_t cap,
                            size_t *count);

// Sets the functions that a local world asks about contacts from the next dcd_step on; null removes them. `hooks` is read during the call; the
// functions and `context` must be there until others are set or the world is destroyed.
//
// They are called from within dcd_step (or the step that dcd_step_begin began), by any thread of the library and by several at the same time, in
// no order that is promised. They must return normally (no longjmp, no C++ exception), guard what they share, and call no function on a
// world: each is DCD_ERR_BUSY. What pointers lead to is valid during the call. Every region that holds both bodies asks about its
// own copies, so that the answer must depend on the pair and on what you changed between steps, on nothing else: else regions disagree,
// and the result depends on how the world is cut. A pair may be asked about in every step, or only when it begins to be near, for as long
// as it rests.
//
// They are not saved with the world. A recording goes on, and has what they answered: a replay does not call them.
// Errors: DCD_ERR_NULL (world), DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT, DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_hooks_set(DcdWorld world,
                        const DcdHooks *hooks);

// Finds the first body that each of `count` rays meets; hits[i] belongs to rays[i]. Sensors count as bodies, unless `filter`
// overlooks them; a null filter overlooks nothing.
//
// This and the other queries see bodies where they are now, also those made or moved since the last step. Several threads may ask one world
// at the same time, and a hundred and more of one call are spread over DcdWorldDef.threads. They are answered only where the whole world
// is: in a served world they are DCD_ERR_UNSUPPORTED, and dcd_rays_submit, dcd_shape_casts_submit and dcd_overlap_shapes_submit, _points_
// and _boxes_ ask instead.
//
// `rays` and `filter` are read during the call; `hits` has `count` entries.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world, or a body to exclude), DCD_ERR_STRUCT, DCD_ERR_ARGUMENT for numbers that are not
// finite, a direction of length 0, a distance that is not above 0, unknown bits, or more than DCD_MAX_ITEMS,
// DCD_ERR_UNSUPPORTED.
DCD_API
DcdStatus dcd_cast_rays(DcdWorld world,
                        const DcdRay *rays,
                        size_t count,
                        const DcdFilter *filter,
                        DcdRayHit *hits);

// Finds every body that each of `count` rays meets, a collider of it once, the nearest first. The hits of all rays go to `hits`, which
// has `cap` entries, and their number to `total`; those of rays[i] end before hits[ends[i]] and begin where those of the ray
// before end. `ends` has `count` entries. With `cap` 0 `hits` may be null, to ask for the number.
//
// Errors: as dcd_cast_rays, and DCD_ERR_SMALL_BUFFER (then `total` is written all the same, and nothing else).
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
// Errors: as dcd_cast_rays; DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
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

// Finds every body that each of `count` shapes overlaps, by age. Outputs as of dcd_cast_rays_all.
//
// Errors: as dcd_cast_rays_all; DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
DCD_API
DcdStatus dcd_overlap_shapes(DcdWorld world,
                             const DcdShapeQuery *shapes,
                             size_t count,
                             const DcdFilter *filter,
                             DcdOverlap *found,
                             size_t cap,
                             size_t *ends,
                             size_t *total);

// Finds every body that each of `count` points lies in, by age. Outputs as of dcd_cast_rays_all.
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

// Finds every body whose AABB, its own box along the axes of the world, touches each of `count` boxes, by age: what may overlap it, at
// little cost. Outputs as of dcd_cast_rays_all.
//
// Errors: as dcd_cast_rays_all; DCD_ERR_ARGUMENT also for a box whose min is above its max.
DCD_API
DcdStatus dcd_overlap_boxes(DcdWorld world,
                            const DcdBoxQuery *boxes,
                            size_t count,
                            const DcdFilter *filter,
                            DcdOverlap *found,
                            size_t cap,
                            size_t *ends,
                            size_t *total);

// Calls `function` with every body that one ray meets, a collider of it once, in no order that is promised, until it has enough: for a
// question that dcd_cast_rays does not ask, such as what is thickest on the way, or the first body that a rule of yours lets count.
//
// `ray` and `filter` are read during the call. Errors: as dcd_cast_rays.
DCD_API
DcdStatus dcd_cast_ray_each(DcdWorld world,
                            const DcdRay *ray,
                            const DcdFilter *filter,
                            DcdRayFn function,
                            void *context);

// Calls `function` with every body that one shape meets which moves straight, a collider of it once, in no order that is promised, until it
// has enough: for a way on which a rule of yours says what stops the shape.
//
// `cast` and `filter` are read during the call. Errors: as dcd_cast_shapes; DCD_ERR_ARGUMENT also for a cast that turns.
DCD_API
DcdStatus dcd_cast_shape_each(DcdWorld world,
                              const DcdShapeCast *cast,
                              const DcdFilter *filter,
                              DcdShapeCastFn function,
                              void *context);

// Calls `function` with every body that a shape overlaps, a collider of it once, in no order that is promised, until it has enough: to know
// whether a place is free, one is.
//
// `shape` and `filter` are read during the call. Errors: as dcd_overlap_shapes.
DCD_API
DcdStatus dcd_overlap_shape_each(DcdWorld world,
                                 const DcdShapeQuery *shape,
                                 const DcdFilter *filter,
                                 DcdOverlapFn function,
                                 void *context);

// Calls `function` with every body whose AABB touches a box, as dcd_overlap_boxes, until it has enough.
//
// `box` and `filter` are read during the call. Errors: as dcd_overlap_boxes.
DCD_API
DcdStatus dcd_overlap_box_each(DcdWorld world,
                               const DcdBoxQuery *box,
                               const DcdFilter *filter,
                               DcdOverlapFn function,
                               void *context);

// Submits `count` rays, to find what each meets first; dcd_query_poll fetches the answer. As dcd_cast_rays, and in a served world too: a
// client, a participant or the server's program asks the nodes, each answers for the bodies that it owns, as they are after one and the same step, and
// the nearest counts. That takes some steps, longer while nodes join or leave. In a local world the answer is there at once. What a server's
// program did since its last dcd_step is there for its question: that is sent with the next one then.
//
// `rays` and `filter` are read during the call. `out` receives the id of the query, which is open until it is fetched or cancelled.
// Errors: as dcd_cast_rays; DCD_ERR_ARGUMENT also for more than DCD_MAX_SUBMITTED_COST, and for what is longer than 64 KiB on its
// way, shapes and filter included, as so many rays are with as many bodies in the filter; DCD_ERR_BUSY with DCD_MAX_OPEN_QUERIES or
// DCD_MAX_OPEN_COST open, DCD_ERR_NETWORK when the link is gone, DCD_ERR_UNSUPPORTED for a node.
DCD_API
DcdStatus dcd_rays_submit(DcdWorld world,
                          const DcdRay *rays,
                          size_t count,
                          const DcdFilter *filter,
                          DcdQueryId *out);

// Submits `count` shape casts, to find what each meets first; dcd_query_poll_casts fetches the answer. As dcd_cast_shapes, where and when
// dcd_rays_submit answers. The shapes travel along, and may be destroyed after the call.
//
// Errors: as dcd_rays_submit; DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain, a turn longer than
// DCD_MAX_SUBMITTED_TURN, of a shape larger than DCD_MAX_TURNING_SIZE, and a turn with DCD_QUERY_LEAVE.
DCD_API
DcdStatus dcd_shape_casts_submit(DcdWorld world,
                                 const DcdShapeCast *casts,
                                 size_t count,
                                 const DcdFilter *filter,
                                 DcdQueryId *out);

// Submits `count` shapes, to find every body that each overlaps; dcd_query_poll_overlaps fetches the answer. As dcd_overlap_shapes,
// where and when dcd_rays_submit answers. The shapes travel along, and may be destroyed after the call.
//
// Errors: as dcd_rays_submit; DCD_ERR_STALE_ID also for a shape, DCD_ERR_ARGUMENT also for a mesh or terrain.
DCD_API
DcdStatus dcd_overlap_shapes_submit(DcdWorld world,
                                    const DcdShapeQuery *shapes,
                                    size_t count,
                                    const DcdFilter *filter,
                                    DcdQueryId *out);

// Submits `count` points, to find every body that each lies in; dcd_query_poll_overlaps fetches the answer. As dcd_overlap_points,
// where and when dcd_rays_submit answers.
//
// Errors: as dcd_rays_submit.
DCD_API
DcdStatus dcd_overlap_points_submit(DcdWorld world,
                                    const DcdPointQuery *points,
                                    size_t count,
                                    const DcdFilter *filter,
                                    DcdQueryId *out);

// Submits `count` boxes, to find every body whose AABB touches each; dcd_query_poll_overlaps fetches the answer. As
// dcd_overlap_boxes, where and when dcd_rays_submit answers.
//
// Errors: as dcd_rays_submit; DCD_ERR_ARGUMENT also for a box whose min is above its max.
DCD_API
DcdStatus dcd_overlap_boxes_submit(DcdWorld world,
                                   const DcdBoxQuery *boxes,
                                   size_t count,
                                   const DcdFilter *filter,
                                   DcdQueryId *out);

// Fetches the answer to submitted rays, without waiting: hits[i] belongs to rays[i], null where the ray met nothing, and
// `count` receives their number. `hits` has `cap` entries; with `cap` 0 it may be null, to ask for the number, and the query stays
// open unless that is 0. Once it is fetched the query is closed and its id stale.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or query), DCD_ERR_ARGUMENT for a query that is not of rays, DCD_ERR_BUSY while
// the answer is not there: nothing is written, and the query stays open; DCD_ERR_SMALL_BUFFER (then `count` is written all the
// same, and the query stays open), DCD_ERR_NETWORK when the link is gone.
DCD_API
DcdStatus dcd_query_poll(DcdWorld world,
                         DcdQueryId query,
                         DcdRayHit *hits,
                         size_t cap,
                         size_t *count);

// Fetches the answer to submitted casts: hits[i] belongs to casts[i]. For the rest as dcd_query_poll.
DCD_API
DcdStatus dcd_query_poll_casts(DcdWorld world,
                               DcdQueryId query,
                               DcdShapeHit *hits,
                               size_t cap,
                               size_t *count);

// Fetches the answer to submitted overlaps: outputs as of dcd_overlap_shapes, `ends` with an entry for each that was submitted.
// For the rest as dcd_query_poll, with `found` for `hits`, and for `count` `total`.
//
// Errors: as dcd_query_poll, and DCD_ERR_LIMIT when more than DCD_MAX_SUBMITTED_OVERLAPS were found; then the query is closed.
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

// Lists the regions into `out`, which has `cap` entries, and their number into `count`. With `cap` 0 `out` may be null, to
// ask for the number. A server and a node list none: dcd_world_info has their number. In a served world that follows its load they change as it runs: ask again now and then.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not).
DCD_API
DcdStatus dcd_regions(DcdWorld world,
                      DcdRegionInfo *out,
                      size_t cap,
                      size_t *count);

// Lists the borders into `out`, which has `cap` entries, and their number into `count`, in order of (a, b): of each two
// regions that have a face in common or hold the same body. With `cap` 0 `out` may be null, to ask for the number.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not),
// DCD_ERR_UNSUPPORTED in a served world, whatever the role: ask a local one of the same cut and coupling.
DCD_API DcdStatus dcd_borders(DcdWorld world, DcdBorderInfo *out, size_t cap, size_t *count);

// Reads who owns a body: nobody, if it is fixed (DCD_NO_REGION, DCD_NO_NODE, without DCD_OWNER_HERE).
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED for a node. A server is told no owner: DCD_NO_REGION.
DCD_API
DcdStatus dcd_body_owner(DcdWorld world,
                         DcdBodyId body,
                         DcdOwner *out);

// Sets the area of interest of a client or participant, what it hears of from now on: bodies whose origin is within `radius`
// metres of `centre` (world space), its own avatars, and bodies whose origin is within 8 m of these. A long body whose origin is
// farther off may touch an avatar, and only the contact is told of (dcd_events): give a radius that has the origins of such
// bodies in it. It saves bytes and time where the world is large, more where you join with one
// (DcdClientDef.interest_radius). A radius of 0 or less, or of infinity, is everything, as at
// first; `centre` may be null then. Call it as often as you like: as long as the centre stays within a twentieth of the radius
// of where it was said last, nothing is sent.
//
// Bodies outside stay valid, at the place and velocity where they were heard of last, with DCD_STATE_OUTSIDE in
// DcdStateView.flags and DcdBodyInfo.outside; that they are removed or touch your avatars is told all the same, and that they
// appear, unless you joined with an interest. What
// leaves is told so; what comes in, by its own motion or as the interest moves over it, is told within a few steps, also when
// it rests by then, and counts as outside until it is. Some bodies a little beyond the radius are told of too.
//
// A local world shows everything all the same. The interest lasts until it is set again or the world is destroyed.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a centre that is out of range or a radius that is NaN,
// DCD_ERR_NETWORK when the link is gone, DCD_ERR_UNSUPPORTED for a server or a node.
DCD_API DcdStatus dcd_interest_set(DcdWorld world, const double *centre, double radius);

// Limits what a client or participant is sent of bodies, in bytes per second with all headers but IP's; 0: as many as the link carries, as
// at first. Of more bodies than there is room for, those are told first that are most wrong here, as seen from your avatars, and for
// longest; what is not told for a while is shown going on as it did, for two seconds at most (dcd_view_time). Below some
// 2,000 bytes per second little is told but that time goes on. For players at home 16,000 (128 kbit/s) suits some hundred moving bodies near
// them; `dcd client --bandwidth` says what the bytes of a world are for.
//
// A local world knows all. The limit lasts until it is set again or the world is destroyed.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_NETWORK when the link is gone, DCD_ERR_UNSUPPORTED for a server or a node.
DCD_API
DcdStatus dcd_bandwidth_set(DcdWorld world,
                            uint32_t bytes_per_second);

// Reads the counters of a world.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API DcdStatus dcd_stats(DcdWorld world, DcdStats *out);

// Writes the counters as text for people, one per line, NUL-terminated, into `buf` of `cap` bytes; `needed` receives the
// size with NUL. `buf` may be null with `cap` 0, to ask for the size.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `needed` is written all the same and `buf` is not).
DCD_API DcdStatus dcd_stats_text(DcdWorld world, char *buf, size_t cap, size_t *needed);

// Checks what must hold in a local world between two steps, for tests and reports of bugs: that each body has one owner, that owners and
// regions agree on who holds what, that parts of masses add up, that numbers are finite. Writes what does not, one finding per line,
// NUL-terminated, into `buf` of `cap` bytes; `needed` receives the size with NUL: 1 as long as all is well, and in a served world, which has
// nothing to check here. `buf` may be null with `cap` 0, to ask for the size. It costs a look at every body.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `needed` is written all the same and `buf` is not).
DCD_API
DcdStatus dcd_validate(DcdWorld world,
                       char *buf,
                       size_t cap,
                       size_t *needed);

// Hashes the pose and velocity of every movable body to one number: equal worlds, equal numbers, whatever the number of
// threads.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED in a served world.
DCD_API DcdStatus dcd_state_hash(DcdWorld world, uint64_t *out);

// Reads what the last dcd_step of a local world took by phase, 0 before the first and of regions that rested, and what there is now.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED in a served world, of which dcd_stats tells the wall time of taking in
// what came and the bytes of the network.
DCD_API
DcdStatus dcd_profile(DcdWorld world,
                      DcdProfile *out);

// Keeps a local world in memory as it is now, to go back to: for rollback, where a game computes some ticks again with inputs that
// came late. `out` is the checkpoint; dcd_checkpoint_destroy frees it, dcd_world_destroy all of its world.
//
// Little is copied here: the next step copies the regions that it changes, each on its own thread, and none that rests. A checkpoint
// takes as much memory as what has changed since.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED for a served world, which dcd_snapshot_save_file saves.
DCD_API
DcdStatus dcd_checkpoint_create(DcdWorld world,
                                DcdCheckpointId *out);

// Keeps the world anew as it is now, in place of what the checkpoint kept before: a game of rollback has one per tick that it may go
// back, and uses them in turn. Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID.
DCD_API
DcdStatus dcd_checkpoint_save(DcdWorld world,
                              DcdCheckpointId checkpoint);

// Goes back to a checkpoint of this world, as often as wanted; from there it goes on to the same bits. All is as it was then:
// bodies, joints, regions, settings, dcd_state_view and dcd_events. Threads, shapes and hooks stay as they are now, and so
// do other checkpoints, later ones too. A recording of the world goes on from here. What was changed between the last step and the
// checkpoint is changed: dcd_state_view shows it so, and the material of a body that was destroyed is 0 in dcd_events.
//
// Ids of bodies and joints that were given since are given again, in the same order, so that computing a tick again gives the same
// ones: forget those that you have.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, also for a checkpoint of another world.
DCD_API
DcdStatus dcd_checkpoint_restore(DcdWorld world,
                                 DcdCheckpointId checkpoint);

// Destroys a checkpoint; its world stays as it is. Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice).
DCD_API DcdStatus dcd_checkpoint_destroy(DcdWorld world, DcdCheckpointId checkpoint);

// Sets where a world is looked at from, in place of what was set before: regions farther than what is seen from there are
// stepped less often, as DcdWorldDef.fidelity allows. Without viewpoints, as at first, all of a local world is looked at. Call it as often as viewers
// move. A world that is served from it (DcdServerDef.source) keeps its fidelity and viewpoints, and is looked at by its clients, too
// (dcd_interest_set).
//
// Of a served world its server may say so, too: it counts some ticks later, on all nodes from the same tick on, and is kept when the server stops.
// Without viewpoints only clients look.
//
// `viewpoints` points to `count` of them, read during the call; it may be null when there are none.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a place out of range or a radius that is negative or NaN,
// DCD_ERR_UNSUPPORTED for a node or a client; DCD_ERR_NETWORK once a served world has ended.
DCD_API
DcdStatus dcd_viewpoints_set(DcdWorld world,
                             const DcdViewpoint *viewpoints,
                             size_t count);

// Reads what fidelity saves and costs. Where all is computed in full, share_of_full_time is 1 and the rest says nothing. The server of a world says
// what it was told last, every 60 steps; nodes and clients do not know, and say the same as where all is computed in full.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
DCD_API
DcdStatus dcd_fidelity_report(DcdWorld world,
                              DcdFidelityReport *out);

// Begins to record a local world to a file: a snapshot of it as it is now, what is done to it from now on, and a digest of each region
// after each step. `dcd replay FILE` computes it again from that, bit for bit, `dcd diff` finds where two recordings differ. A thread
// of the library writes the file; what a crash loses is the last tenth of a second. A recording that was going on ends. Nodes and
// participants are recorded from their beginning, and servers too: `record_path` of DcdServerDef, DcdNodeDef and DcdParticipantDef.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_record(DcdWorld world,
                     const char *path);

// Begins to record a local world in memory, and keeps at least the last `seconds` of it by the clock on the wall, about twice as much at most, for "what happened just
// now?": dcd_record_keep writes it. Each stretch of so many seconds begins with a snapshot. A recording that was going on ends.
//
// Errors: DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for `seconds` that are not above 0 and up to 86,400, DCD_ERR_UNSUPPORTED in a served world.
DCD_API
DcdStatus dcd_record_last(DcdWorld world,
                          float seconds);

// Writes to a file what dcd_record_last has kept, and goes on recording. A file that is there is replaced once the new one is whole.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_ARGUMENT if nothing is recorded in memory, DCD_ERR_UNSUPPORTED in a
// served world.
DCD_API
DcdStatus dcd_record_keep(DcdWorld world,
                          const char *path);

// Ends the recording of a local world, and waits until it is written. Does nothing where nothing is recorded, and in a served world.
//
// Errors: DCD_ERR_STALE_ID, DCD_ERR_IO if anything of it could not be written: the file ends there.
DCD_API
DcdStatus dcd_record_stop(DcdWorld world);

// Saves a snapshot of a world: bodies, joints, contacts, regions, settings. A local world goes on from there to the same bits, in this
// program or another one of the same build. Handles of shapes, views and your user_data of the world are not part of it.
//
// A server saves the world as it is after one tick, for which its nodes stop for some ticks: as a local world, avatars too, without
// contacts. What its program did since its last dcd_step is not in it. It waits for half a minute at most.
//
// The bytes go to `buf` of `cap` bytes, and their number to `needed`. `buf` may be null with `cap` 0, to ask for the number, which
// costs as much as saving; while nothing changes it stays the same. A served world changes: save it to a file.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `needed` is written all the same and `buf` is not),
// DCD_ERR_TIMEOUT when nodes do not answer their server, DCD_ERR_UNSUPPORTED for a client, participant or node.
DCD_API
DcdStatus dcd_snapshot_save(DcdWorld world,
                            void *buf,
                            size_t cap,
                            size_t *needed);

// Saves a world to a file, as dcd_snapshot_save; `dcd run` goes on with such a file, and writes them by --save. A file that is
// there is replaced once the new one is whole.
//
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_TIMEOUT when nodes do not answer their server, DCD_ERR_UNSUPPORTED
// for a client, participant or node.
DCD_API DcdStatus dcd_snapshot_save_file(DcdWorld world, const char *path);

// Restores a snapshot of `size` bytes into a world: into the one that it was saved from, to go back, or into
// any other, which loses what it held. Threads and shapes stay those of this world; all else is as saved, gravity and
// regions too.
//
// Ids of bodies and joints that this world gave are valid if the saved world has them, else stale; those given
// later are new. dcd_body_at finds bodies by number, and dcd_state_view and dcd_events are as after the last step before saving, but
// for the user_data of bodies that were destroyed, which is 0.
//
// A server's world goes on with the bodies and joints of the snapshot, for all nodes and clients; its ticks and regions go on, and
// tick length and gravity must be the same. What its program did since its last dcd_step is dropped. Avatars are their
// clients': those that are in both go where they were, and none comes or goes.
//
// `data` is read during the call. After an error the world is as it was. Damage is found; malice is not: load nothing that you
// do not trust.
// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for bytes that are no snapshot or damaged, DCD_ERR_VERSION for one of
// another build of the library, DCD_ERR_UNSUPPORTED for a client, participant or node.
DCD_API
DcdStatus dcd_snapshot_load(DcdWorld world,
                            const void *data,
                            size_t size);

// Restores a snapshot from a file into a world, as dcd_snapshot_load.
//
// Errors: as dcd_snapshot_load, and DCD_ERR_IO when the file cannot be read.
DCD_API DcdStatus dcd_snapshot_load_file(DcdWorld world, const char *path);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus


/* What each struct starts from. */

/* One region, a thread per core, Earth's gravity, 60 steps a second, a box of 128 m around the origin, up to 400 m/s. */
#define DCD_WORLD_DEF_INIT \
    { (uint32_t)sizeof(DcdWorldDef), 0, 0, 4, { 0.0f, -9.81f, 0.0f }, 1.0f / 60.0f, \
      { -64.0, -64.0, -64.0 }, { 64.0, 64.0, 64.0 }, 0, 0, 0, 0, 0, 0, 0.0f, 0, 0.0f, 0, 0.0f }

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

/* Nothing is overlooked. */
#define DCD_FILTER_INIT { (uint32_t)sizeof(DcdFilter), 0, 0, 0xFFFFFFFFu, NULL, 0 }
#define DCD_RAY_INIT { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 1.0e6f, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_SHAPE_CAST_INIT \
    { { 0 }, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, \
      0.0f, 0xFFFFFFFFu, { 0 }, 0, 0 }
#define DCD_POINT_QUERY_INIT { { 0.0, 0.0, 0.0 }, 1.0e6f, 0xFFFFFFFFu, { 0 }, 0, 0 }
#define DCD_SHAPE_QUERY_INIT \
    { { 0 }, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_BOX_QUERY_INIT { { 0.0, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }, { 0 }, 0xFFFFFFFFu, 0 }

/* Shapes, everywhere: by no function yet. */
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
/* No function is asked. */
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
DCD_ASSERT_(sizeof(DcdWorldDef) == 128);
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
DCD_ASSERT_(offsetof(DcdSettings, reserved) == 76);
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
DCD_ASSERT_(offsetof(DcdConnectionInfo, rtt_ms) == 24);
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
DCD_ASSERT_(offsetof(DcdRegionInfo, replicas) == 8);
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
DCD_ASSERT_(offsetof(DcdStats, replicas) == 24);
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
