#ifndef DCD_H
#define DCD_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#if defined(_WIN32) && defined(DCD_SHARED)
#define DCD_API __declspec(dllimport)
#else
#define DCD_API
#endif
#define DCD_VERSION_MAJOR 0u
#define DCD_VERSION_MINOR 1u
#define DCD_VERSION_PATCH 0u
#define DCD_VERSION (DCD_VERSION_MAJOR * 1000000u + DCD_VERSION_MINOR * 1000u + DCD_VERSION_PATCH)
#define DCD_MAX_ITEMS 16777216
#define DCD_MAX_NUMBER 1.0e6
#define DCD_MAX_COORDINATE 1.0e9
#define DCD_BODY_CCD 1
#define DCD_BODY_SENSOR 2
#define DCD_BODY_NO_SLEEP 4
#define DCD_BODY_ASLEEP 8
#define DCD_BODY_DISABLED 16
#define DCD_BODY_FAST_SPIN 32
#define DCD_BODY_NO_GYRO 64
#define DCD_BODY_ANY_GROUP 128
#define DCD_EVENT_CONTACT 1
#define DCD_EVENT_FORCE 2
#define DCD_LOCK_X 1
#define DCD_LOCK_Y 2
#define DCD_LOCK_Z 4
#define DCD_LOCK_TURN_X 8
#define DCD_LOCK_TURN_Y 16
#define DCD_LOCK_TURN_Z 32
#define DCD_NO_REGION UINT32_MAX
#define DCD_CUT_X 1
#define DCD_CUT_Y 2
#define DCD_CUT_Z 4
#define DCD_SERVER_FRESH 1
#define DCD_SERVER_UNPACED 2
#define DCD_MIN_SIZE 1.0e-4
#define DCD_ALL_COLLIDERS UINT32_MAX
#define DCD_MAX_COLLIDERS 4096
#define DCD_PAIR_DYNAMIC_DYNAMIC 1
#define DCD_PAIR_DYNAMIC_KINEMATIC 2
#define DCD_PAIR_DYNAMIC_FIXED 4
#define DCD_PAIR_KINEMATIC_KINEMATIC 8
#define DCD_PAIR_KINEMATIC_FIXED 16
#define DCD_PAIR_FIXED_FIXED 32
#define DCD_COLLIDER_SENSOR 1
#define DCD_COLLIDER_DISABLED 2
#define DCD_COLLIDER_ANY_GROUP 4
#define DCD_JOINT_LIMIT 1
#define DCD_JOINT_MOTOR 2
#define DCD_JOINT_COLLIDE 4
#define DCD_JOINT_DISABLED 8
#define DCD_FOREVER UINT64_MAX
#define DCD_STATE_SLEEPING 1
#define DCD_STATE_OUTSIDE 2
#define DCD_MAX_REASON 256
#define DCD_SEND_UNRELIABLE 1
#define DCD_MAX_MESSAGE 32768
#define DCD_MAX_DATAGRAM 1024
#define DCD_CONTACT_BEGAN 0
#define DCD_CONTACT_ENDED 1
#define DCD_CONTACT_SENSOR 1
#define DCD_CHANGE_APPEARED 1
#define DCD_CHANGE_REMOVED 2
#define DCD_CHANGE_REFUSED 3
#define DCD_REFUSED_VERSION 1
#define DCD_REFUSED_NOT_YOURS 2
#define DCD_REFUSED_UNKNOWN 3
#define DCD_REFUSED_EXISTS 4
#define DCD_REFUSED_TOO_FAST 5
#define DCD_REFUSED_LATE 6
#define DCD_REFUSED_SHAPE 7
#define DCD_REFUSED_TOO_MANY 8
#define DCD_REFUSED_COSTLY 9
#define DCD_REFUSED_TOO_FAR 10
#define DCD_REFUSED_MAY_NOT_BUILD 11
#define DCD_REFUSED_NOT_TO_BE_BUILT 12
#define DCD_EVENTS_DISCONNECTED 1
#define DCD_HOOK_FILTER 1
#define DCD_HOOK_DETECT 2
#define DCD_HOOK_MODIFY 4
#define DCD_FILTER_NO_FIXED 1
#define DCD_FILTER_NO_KINEMATIC 2
#define DCD_FILTER_NO_DYNAMIC 4
#define DCD_FILTER_NO_SENSORS 8
#define DCD_FILTER_NO_SOLIDS 16
#define DCD_QUERY_HOLLOW 1
#define DCD_QUERY_LEAVE 2
#define DCD_HIT_INSIDE 1
#define DCD_MAX_SUBMITTED_COST 1024
#define DCD_SHAPE_COST 8
#define DCD_OVERLAPS_COST 64
#define DCD_MAX_OPEN_QUERIES 64
#define DCD_MAX_OPEN_COST 4096
#define DCD_MAX_SUBMITTED_OVERLAPS 4096
#define DCD_MAX_SUBMITTED_TURN 64.0
#define DCD_MAX_TURNING_SIZE 100.0
#define DCD_NO_NODE UINT32_MAX
#define DCD_OWNER_HERE 1
#define DCD_OWNER_BY_PLACE 4
#define DCD_OWNER_HEARD 2
typedef int32_t DcdStatus;
typedef uint32_t DcdLogLevel;
typedef void (*DcdLogFn)(void *user, DcdLogLevel level, const char *message, size_t length);
typedef void (*DcdBugFn)(void *context, const char *message, const char *file, uint32_t line);
typedef void *(*DcdAllocateFn)(void *context, size_t size, size_t alignment);
typedef void (*DcdFreeFn)(void *context, void *block, size_t size, size_t alignment);
typedef uint32_t DcdCoupling;
typedef uint32_t DcdPreset;
typedef uint32_t DcdFidelity;
typedef struct DcdCut {
    double at;
    uint32_t axis;
    uint32_t reserved;
} DcdCut;
typedef struct DcdWorldDef {
    uint32_t struct_size;
    uint32_t threads;
    uint32_t regions;
    uint32_t solver_iterations;
    float gravity[3];
    float dt;
    double min[3];
    double max[3];
    uint64_t user_data;
    DcdCoupling coupling;
    DcdPreset preset;
    uint32_t exchanges;
    uint32_t depth;
    uint32_t island_limit;
    float tolerance;
    uint32_t axes;
    float speed_limit;
    DcdFidelity fidelity;
    float fidelity_limit;
    const DcdCut *cuts;
    uint32_t cut_count;
    uint32_t reserved;
} DcdWorldDef;
typedef struct DcdWorld {
    uint64_t v;
} DcdWorld;
typedef uint32_t DcdRole;
typedef struct DcdWorldInfo {
    uint32_t struct_size;
    DcdRole role;
    uint64_t tick;
    uint64_t user_data;
    uint32_t regions;
    float dt;
    float gravity[3];
    uint32_t client;
    float speed_limit;
    uint32_t reserved;
} DcdWorldInfo;
typedef struct DcdClientDef {
    uint32_t struct_size;
    uint32_t timeout_ms;
    const char *server;
    const char *token;
    const char *identity_path;
    uint64_t user_data;
    double interest_centre[3];
    double interest_radius;
    uint32_t give_up_ms;
    uint32_t reserved;
} DcdClientDef;
typedef struct DcdParticipantDef {
    uint32_t struct_size;
    uint32_t timeout_ms;
    const char *server;
    const char *token;
    const char *identity_path;
    uint64_t user_data;
    uint32_t threads;
    uint32_t give_up_ms;
    double interest_centre[3];
    double interest_radius;
    const char *record_path;
    const char *metrics;
} DcdParticipantDef;
typedef struct DcdBodyId {
    uint64_t v;
} DcdBodyId;
typedef struct DcdGroupDef {
    uint32_t struct_size;
    uint32_t lag_ticks;
    float near_ms;
    float far_ms;
    float agree;
    uint32_t size;
} DcdGroupDef;
typedef struct DcdServerDef {
    uint32_t struct_size;
    uint32_t nodes;
    const char *scene;
    const char *const *params;
    size_t param_count;
    const DcdWorldDef *world;
    DcdWorld source;
    const DcdGroupDef *groups;
    const char *listen;
    const char *data_path;
    uint64_t last_tick;
    float avatar_speed;
    uint32_t flags;
    uint64_t user_data;
    uint32_t state_every;
    float verify;
    const char *metrics;
    const char *directory;
    const char *record_path;
    float avatar_expiry;
    uint32_t reserved;
} DcdServerDef;
typedef struct DcdNodeDef {
    uint32_t struct_size;
    uint32_t timeout_ms;
    const char *server;
    const char *token;
    const char *identity_path;
    const char *listen;
    uint64_t user_data;
    uint32_t threads;
    uint32_t give_up_ms;
    const char *record_path;
    const char *metrics;
    const char *advertise;
} DcdNodeDef;
typedef struct DcdShapeId {
    uint64_t v;
} DcdShapeId;
typedef struct DcdFrame {
    float p[3];
    float q[4];
} DcdFrame;
typedef uint32_t DcdBodyType;
typedef struct DcdPose {
    double p[3];
    float q[4];
} DcdPose;
typedef struct DcdVelocity {
    float linear[3];
    float angular[3];
} DcdVelocity;
typedef uint32_t DcdCombineRule;
typedef struct DcdBodyDef {
    uint32_t struct_size;
    DcdBodyType body_type;
    DcdPose pose;
    DcdVelocity velocity;
    DcdShapeId shape;
    float density;
    float mass;
    float friction;
    float restitution;
    DcdCombineRule friction_rule;
    DcdCombineRule restitution_rule;
    float contact_skin;
    float linear_damping;
    float angular_damping;
    float gravity_scale;
    uint32_t flags;
    uint32_t locked;
    uint32_t events;
    float force_threshold;
    uint32_t groups;
    uint32_t mask;
    uint32_t solver_groups;
    uint32_t solver_mask;
    uint32_t pairs;
    int32_t dominance;
    float soft_ccd;
    float sleep_linear;
    float sleep_angular;
    float sleep_after;
    float extra_mass;
    float extra_centre[3];
    float extra_inertia[3];
    uint32_t extra_solver_iterations;
    uint32_t extra_pgs_iterations;
    uint32_t hooks;
    uint64_t user_data;
    uint64_t material;
} DcdBodyDef;
typedef struct DcdCharacterDef {
    uint32_t struct_size;
    float step_height;
    float step_depth;
    float max_climb;
    float min_slide;
    float snap;
    float gap;
    float mass;
    uint32_t reserved;
} DcdCharacterDef;
typedef struct DcdWheel {
    float at[3];
    float down[3];
    float axle[3];
    float rest_length;
    float travel;
    float radius;
    float stiffness;
    float compression;
    float relaxation;
    float max_force;
    float grip;
    float side_grip;
    float engine_force;
    float brake_force;
    float steering;
} DcdWheel;
typedef struct DcdVehicleDef {
    uint32_t struct_size;
    uint32_t wheel_count;
    const DcdWheel *wheels;
    float top_speed;
    uint32_t reserved;
} DcdVehicleDef;
typedef struct DcdDrive {
    float throttle;
    float brake;
    float steering;
} DcdDrive;
typedef struct DcdGround {
    DcdBodyId body;
    uint64_t material;
    double point[3];
    float normal[3];
    float slope;
    uint32_t collider;
    uint32_t reserved;
} DcdGround;
typedef struct DcdCharacterState {
    uint32_t struct_size;
    bool grounded;
    bool sliding;
    uint8_t reserved[2];
    DcdGround ground;
} DcdCharacterState;
typedef struct DcdWheelState {
    DcdPose pose;
    float suspension;
    float steering;
    float rolled;
    float spin;
    DcdGround ground;
} DcdWheelState;
typedef struct DcdBodyInfo {
    uint32_t struct_size;
    DcdBodyType body_type;
    uint64_t user_data;
    double centre[3];
    float mass;
    uint32_t region;
    float force[3];
    float torque[3];
    uint32_t colliders;
    bool sleeping;
    bool outside;
    uint8_t reserved[2];
} DcdBodyInfo;
typedef struct DcdExplosion {
    uint32_t struct_size;
    uint32_t mask;
    double centre[3];
    float radius;
    float falloff;
    float impulse;
    uint32_t reserved;
} DcdExplosion;
typedef struct DcdFluid {
    uint32_t struct_size;
    uint32_t mask;
    double min[3];
    double max[3];
    double surface;
    float density;
    float velocity[3];
    float drag;
    float damping;
    float lift;
    uint32_t reserved;
} DcdFluid;
typedef struct DcdBodyProperties {
    uint32_t struct_size;
    DcdBodyType body_type;
    uint32_t flags;
    uint32_t locked;
    int32_t dominance;
    float linear_damping;
    float angular_damping;
    float gravity_scale;
    float soft_ccd;
    float sleep_linear;
    float sleep_angular;
    float sleep_after;
    float extra_mass;
    float extra_centre[3];
    float extra_inertia[3];
    uint32_t extra_solver_iterations;
    uint32_t extra_pgs_iterations;
    uint32_t reserved;
    uint64_t user_data;
} DcdBodyProperties;
typedef struct DcdColliderProperties {
    uint32_t struct_size;
    uint32_t flags;
    DcdFrame frame;
    float density;
    float mass;
    float friction;
    float restitution;
    DcdCombineRule friction_rule;
    DcdCombineRule restitution_rule;
    float contact_skin;
    uint32_t events;
    float force_threshold;
    uint32_t groups;
    uint32_t mask;
    uint32_t solver_groups;
    uint32_t solver_mask;
    uint32_t pairs;
    uint32_t hooks;
    uint64_t user_data;
} DcdColliderProperties;
typedef uint32_t DcdShapeKind;
typedef struct DcdShapeInfo {
    uint32_t struct_size;
    DcdShapeKind kind;
    float size[3];
    float border;
    DcdFrame frame;
    uint32_t vertex_count;
    uint32_t triangle_count;
    uint32_t rows;
    uint32_t columns;
    uint32_t parts;
    uint32_t reserved;
} DcdShapeInfo;
typedef struct DcdBodyExtent {
    uint32_t struct_size;
    float mass;
    double min[3];
    double max[3];
    float centre[3];
    float inertia[3];
    float axes[4];
} DcdBodyExtent;
typedef uint32_t DcdJointType;
typedef uint32_t DcdMotorModel;
typedef struct DcdJointMotor {
    float position;
    float velocity;
    float stiffness;
    float damping;
    float max_force;
    DcdMotorModel model;
} DcdJointMotor;
typedef struct DcdJointDef {
    uint32_t struct_size;
    DcdJointType joint_type;
    DcdBodyId a;
    DcdBodyId b;
    DcdFrame frame_a;
    DcdFrame frame_b;
    float limit[2];
    DcdJointMotor motor;
    uint32_t flags;
    uint32_t locked;
    uint32_t coupled;
    float natural_frequency;
    float damping_ratio;
    uint32_t reserved;
    uint64_t user_data;
} DcdJointDef;
typedef struct DcdJointId {
    uint64_t v;
} DcdJointId;
typedef struct DcdJointInfo {
    uint32_t struct_size;
    DcdJointType joint_type;
    DcdBodyId a;
    DcdBodyId b;
    uint64_t user_data;
    DcdFrame frame_a;
    DcdFrame frame_b;
    DcdFrame offset;
    float position;
    float force[3];
    float natural_frequency;
    float damping_ratio;
    uint32_t flags;
    uint32_t locked;
    uint32_t coupled;
    uint32_t limited;
    uint32_t driven;
} DcdJointInfo;
typedef uint32_t DcdJointAxis;
typedef void (*DcdTaskFn)(void *task);
typedef void *(*DcdEnqueueFn)(void *context, DcdTaskFn run, void *task);
typedef void (*DcdFinishFn)(void *context, void *started);
typedef struct DcdTasks {
    uint32_t struct_size;
    uint32_t reserved;
    void *context;
    DcdEnqueueFn enqueue;
    DcdFinishFn finish;
} DcdTasks;
typedef uint32_t DcdFrictionModel;
typedef struct DcdSettings {
    uint32_t struct_size;
    uint32_t solver_iterations;
    float gravity[3];
    float dt;
    float length_unit;
    float speed_limit;
    float contact_frequency;
    float contact_damping;
    float static_frequency;
    float static_damping;
    float max_correction;
    float allowed_overlap;
    float contact_margin;
    float warm_start;
    uint32_t internal_iterations;
    uint32_t ccd_substeps;
    float tolerance;
    DcdFrictionModel friction_model;
} DcdSettings;
typedef struct DcdStateView {
    uint32_t struct_size;
    uint32_t slot_count;
    uint64_t tick;
    size_t count;
    const DcdBodyId *ids;
    const DcdPose *poses;
    const DcdVelocity *velocities;
    const uint64_t *user_data;
    const uint32_t *flags;
    const uint32_t *regions;
    const uint32_t *slots;
} DcdStateView;
typedef uint32_t DcdField;
typedef struct DcdViewTime {
    uint32_t struct_size;
    uint32_t reserved;
    double now;
    double shown;
    double predicted;
    double clock_error;
    double input_delay;
} DcdViewTime;
typedef uint32_t DcdDrawFlags;
typedef void (*DcdDrawPointFn)(void *context, const double *at, float size, uint32_t colour);
typedef void (*DcdDrawLineFn)(void *context, const double *from, const double *to, uint32_t colour);
typedef void (*DcdDrawBoxFn)(void *context, const double *min, const double *max, uint32_t colour);
typedef uint32_t DcdDrawnKind;
typedef struct DcdDrawnShape {
    DcdDrawnKind kind;
    uint32_t mesh;
    float size[3];
    uint32_t reserved;
    const float *vertices;
    size_t vertex_count;
    const uint32_t *triangles;
    size_t triangle_count;
} DcdDrawnShape;
typedef void (*DcdDrawShapeFn)(void *context,
                               DcdBodyId body,
                               const DcdDrawnShape *shape,
                               const DcdPose *pose,
                               uint32_t colour);
typedef void (*DcdDrawTextFn)(void *context, const double *at, const char *text, uint32_t colour);
typedef struct DcdDebugDraw {
    uint32_t struct_size;
    DcdDrawFlags flags;
    void *context;
    DcdDrawPointFn draw_point;
    DcdDrawLineFn draw_line;
    DcdDrawBoxFn draw_box;
    DcdDrawShapeFn draw_shape;
    DcdDrawTextFn draw_text;
    double min[3];
    double max[3];
    float velocity_scale;
    float force_scale;
} DcdDebugDraw;
typedef struct DcdPrediction {
    uint32_t struct_size;
    uint32_t bodies;
    uint64_t ticks;
    uint64_t replays;
    uint64_t corrections;
    double largest_correction;
    double last_frame;
    double longest_frame;
} DcdPrediction;
typedef struct DcdConnectionId {
    uint64_t v;
} DcdConnectionId;
typedef uint32_t DcdConnectionState;
typedef struct DcdConnectionInfo {
    uint32_t struct_size;
    DcdConnectionState state;
    DcdRole role;
    uint32_t node;
    uint32_t client;
    float loss;
    double rtt;
    double age;
    uint64_t bytes_in;
    uint64_t bytes_out;
    uint64_t udp_bytes_in;
    uint64_t udp_bytes_out;
    uint64_t messages_in;
    uint64_t messages_out;
    uint64_t dropped;
    uint64_t bytes_waiting;
} DcdConnectionInfo;
typedef struct DcdContact {
    DcdBodyId a;
    DcdBodyId b;
    uint64_t user_a;
    uint64_t user_b;
    double point[3];
    float normal[3];
    float speed;
    uint32_t kind;
    uint32_t flags;
    uint32_t collider_a;
    uint32_t collider_b;
    uint64_t material_a;
    uint64_t material_b;
} DcdContact;
typedef struct DcdContactForce {
    DcdBodyId a;
    DcdBodyId b;
    uint64_t user_a;
    uint64_t user_b;
    float force[3];
    float magnitude;
    uint32_t collider_a;
    uint32_t collider_b;
    uint64_t material_a;
    uint64_t material_b;
} DcdContactForce;
typedef struct DcdTransfer {
    DcdBodyId body;
    uint64_t user_data;
    uint32_t from;
    uint32_t to;
} DcdTransfer;
typedef struct DcdBodyChange {
    DcdBodyId body;
    uint64_t user_data;
    uint32_t kind;
    uint32_t reason;
} DcdBodyChange;
typedef uint32_t DcdCause;
typedef struct DcdConnectionEvent {
    DcdConnectionId connection;
    DcdConnectionState state;
    DcdRole role;
    uint32_t node;
    uint32_t client;
    DcdCause cause;
    uint32_t reserved;
    char reason[DCD_MAX_REASON];
} DcdConnectionEvent;
typedef struct DcdMessage {
    DcdConnectionId connection;
    const void *data;
    size_t size;
    DcdRole role;
    uint32_t node;
    uint32_t client;
    uint32_t flags;
} DcdMessage;
typedef struct DcdJointOverload {
    DcdJointId joint;
    uint64_t user_data;
    float force;
    float torque;
} DcdJointOverload;
typedef struct DcdEventView {
    uint32_t struct_size;
    uint32_t flags;
    uint64_t tick;
    const DcdContact *contacts;
    size_t contact_count;
    const DcdContactForce *forces;
    size_t force_count;
    const DcdTransfer *transfers;
    size_t transfer_count;
    const DcdBodyChange *changes;
    size_t change_count;
    const DcdConnectionEvent *connections;
    size_t connection_count;
    const DcdMessage *messages;
    size_t message_count;
    const DcdJointOverload *overloads;
    size_t overload_count;
} DcdEventView;
typedef struct DcdContactPoint {
    DcdBodyId a;
    DcdBodyId b;
    double point[3];
    float normal[3];
    float separation;
    float impulse;
    uint32_t manifold;
    uint32_t collider_a;
    uint32_t collider_b;
    uint64_t material_a;
    uint64_t material_b;
} DcdContactPoint;
typedef uint32_t DcdPairAnswer;
typedef struct DcdHookedPair {
    DcdBodyId a;
    DcdBodyId b;
    uint64_t user_a;
    uint64_t user_b;
    uint64_t material_a;
    uint64_t material_b;
    uint32_t collider_a;
    uint32_t collider_b;
    DcdPose pose_a;
    DcdPose pose_b;
    DcdVelocity velocity_a;
    DcdVelocity velocity_b;
} DcdHookedPair;
typedef DcdPairAnswer (*DcdFilterFn)(void *context, const DcdHookedPair *pair);
typedef bool (*DcdDetectFn)(void *context, const DcdHookedPair *pair);
typedef struct DcdHookedContact {
    float normal[3];
    float separation;
    uint32_t points;
    uint32_t enabled;
    float friction;
    float restitution;
    float surface_velocity[3];
    uint32_t memory;
} DcdHookedContact;
typedef void (*DcdModifyFn)(void *context, const DcdHookedPair *pair, DcdHookedContact *contact);
typedef struct DcdHooks {
    uint32_t struct_size;
    uint32_t reserved;
    void *context;
    DcdFilterFn filter;
    DcdDetectFn detect;
    DcdModifyFn modify;
} DcdHooks;
typedef struct DcdRay {
    double origin[3];
    float direction[3];
    float max_distance;
    DcdBodyId exclude;
    uint32_t mask;
    uint32_t flags;
} DcdRay;
typedef struct DcdFilter {
    uint32_t struct_size;
    uint32_t flags;
    uint32_t groups;
    uint32_t mask;
    const DcdBodyId *exclude;
    size_t exclude_count;
} DcdFilter;
typedef struct DcdRayHit {
    DcdBodyId body;
    uint64_t user_data;
    double point[3];
    float normal[3];
    float distance;
    uint32_t collider;
    uint32_t subshape;
    uint64_t material;
} DcdRayHit;
typedef struct DcdShapeCast {
    DcdShapeId shape;
    DcdPose pose;
    float motion[3];
    float turn[3];
    float margin;
    uint32_t mask;
    DcdBodyId exclude;
    uint32_t flags;
    uint32_t reserved;
} DcdShapeCast;
typedef struct DcdShapeHit {
    DcdBodyId body;
    uint64_t user_data;
    double point[3];
    float normal[3];
    float fraction;
    float point_on_shape[3];
    float normal_on_shape[3];
    uint32_t collider;
    uint32_t subshape;
    uint32_t flags;
    uint32_t reserved;
    uint64_t material;
} DcdShapeHit;
typedef struct DcdPointQuery {
    double point[3];
    float max_distance;
    uint32_t mask;
    DcdBodyId exclude;
    uint32_t flags;
    uint32_t reserved;
} DcdPointQuery;
typedef struct DcdPointHit {
    DcdBodyId body;
    uint64_t user_data;
    double point[3];
    float distance;
    uint32_t collider;
    uint32_t flags;
    uint32_t reserved;
    uint64_t material;
} DcdPointHit;
typedef struct DcdShapeQuery {
    DcdShapeId shape;
    DcdPose pose;
    DcdBodyId exclude;
    uint32_t mask;
    uint32_t reserved;
} DcdShapeQuery;
typedef struct DcdOverlap {
    DcdBodyId body;
    uint64_t user_data;
    uint32_t collider;
    uint32_t reserved;
    uint64_t material;
} DcdOverlap;
typedef struct DcdBoxQuery {
    double min[3];
    double max[3];
    DcdBodyId exclude;
    uint32_t mask;
    uint32_t reserved;
} DcdBoxQuery;
typedef float (*DcdRayFn)(void *context, const DcdRayHit *hit);
typedef float (*DcdShapeCastFn)(void *context, const DcdShapeHit *hit);
typedef bool (*DcdOverlapFn)(void *context, const DcdOverlap *found);
typedef struct DcdQueryId {
    uint64_t v;
} DcdQueryId;
typedef struct DcdRegionInfo {
    uint32_t region;
    uint32_t bodies;
    uint32_t ghosts;
    uint32_t node;
    double min[3];
    double max[3];
} DcdRegionInfo;
typedef struct DcdBorderInfo {
    uint32_t a;
    uint32_t b;
    uint32_t bodies;
    uint32_t exchanges;
    uint32_t depth;
    float disagreement;
} DcdBorderInfo;
typedef struct DcdOwner {
    uint32_t struct_size;
    uint32_t region;
    uint32_t node;
    uint32_t holders;
    uint32_t flags;
} DcdOwner;
typedef struct DcdStats {
    uint32_t struct_size;
    uint32_t regions;
    uint64_t ticks;
    uint64_t bodies;
    uint64_t ghosts;
    uint64_t transfers;
    uint64_t quarantined;
    uint64_t updates;
    uint64_t bytes_in;
    uint64_t bytes_out;
    uint64_t udp_bytes_in;
    uint64_t udp_bytes_out;
    double rtt;
    double last_step;
    float disagreement;
    uint32_t exchanges;
} DcdStats;
typedef struct DcdProfile {
    uint32_t struct_size;
    uint32_t reserved;
    double rapier;
    double broad_phase;
    double narrow_phase;
    double islands;
    double solver;
    double ccd;
    double border;
    uint64_t contact_pairs;
    uint64_t contacts;
    uint64_t awake;
    uint64_t joints;
    uint64_t islands_awake;
    uint64_t memory;
} DcdProfile;
typedef struct DcdCheckpointId {
    uint64_t v;
} DcdCheckpointId;
typedef struct DcdViewpoint {
    double at[3];
    double radius;
} DcdViewpoint;
typedef struct DcdFidelityReport {
    uint32_t struct_size;
    float error;
    float low95;
    float high95;
    double share_of_full_time;
    uint64_t audits;
    uint64_t overruns;
    uint32_t levels[3];
    uint32_t reserved;
} DcdFidelityReport;
typedef struct DcdForce {
    float force[3];
    float torque[3];
} DcdForce;
#define DCD_LOG_OFF 0
#define DCD_LOG_ERROR 1
#define DCD_LOG_WARN 2
#define DCD_LOG_INFO 3
#define DCD_LOG_DEBUG 4
#define DCD_LOG_TRACE 5
#define DCD_ROLE_LOCAL 0
#define DCD_ROLE_CLIENT 1
#define DCD_ROLE_PARTICIPANT 2
#define DCD_ROLE_SERVER 3
#define DCD_ROLE_NODE 4
#define DCD_ROLE_BUILDER 5
#define DCD_OK 0
#define DCD_ERR_NULL (-1)
#define DCD_ERR_STALE_ID (-2)
#define DCD_ERR_STRUCT (-3)
#define DCD_ERR_ARGUMENT (-4)
#define DCD_ERR_SMALL_BUFFER (-5)
#define DCD_ERR_BUSY (-6)
#define DCD_ERR_TIMEOUT (-8)
#define DCD_ERR_NETWORK (-9)
#define DCD_ERR_VERSION (-10)
#define DCD_ERR_PANIC (-11)
#define DCD_ERR_UNSUPPORTED (-12)
#define DCD_ERR_IO (-13)
#define DCD_ERR_LIMIT (-14)
#define DCD_FIXED 0
#define DCD_DYNAMIC 1
#define DCD_KINEMATIC 2
#define DCD_KINEMATIC_POSE 3
#define DCD_COMBINE_AVERAGE 0
#define DCD_COMBINE_MIN 1
#define DCD_COMBINE_MULTIPLY 2
#define DCD_COMBINE_MAX 3
#define DCD_COMBINE_SUM 4
#define DCD_COMBINE_GEOMETRIC_MEAN 5
#define DCD_COUPLING_DEFAULT 0
#define DCD_COUPLING_PROXY 1
#define DCD_COUPLING_OWNER 2
#define DCD_COUPLING_OVERLAP 3
#define DCD_COUPLING_ISLAND 4
#define DCD_COUPLING_AUTO 5
#define DCD_PRESET_DEFAULT 0
#define DCD_PRESET_DRAFT 1
#define DCD_PRESET_GAME 2
#define DCD_PRESET_PRECISE 3
#define DCD_SHAPE_BOX 0
#define DCD_SHAPE_SPHERE 1
#define DCD_SHAPE_CAPSULE 2
#define DCD_SHAPE_CYLINDER 3
#define DCD_SHAPE_CONE 4
#define DCD_SHAPE_HULL 5
#define DCD_SHAPE_MESH 6
#define DCD_SHAPE_HEIGHTFIELD 7
#define DCD_SHAPE_COMPOUND 8
#define DCD_SHAPE_HALF_SPACE 9
#define DCD_SHAPE_LINES 10
#define DCD_SHAPE_VOXELS 11
#define DCD_JOINT_FIXED 0
#define DCD_JOINT_REVOLUTE 1
#define DCD_JOINT_PRISMATIC 2
#define DCD_JOINT_SPHERICAL 3
#define DCD_JOINT_ROPE 4
#define DCD_JOINT_SPRING 5
#define DCD_JOINT_GENERIC 6
#define DCD_AXIS_X 0
#define DCD_AXIS_Y 1
#define DCD_AXIS_Z 2
#define DCD_AXIS_TURN_X 3
#define DCD_AXIS_TURN_Y 4
#define DCD_AXIS_TURN_Z 5
#define DCD_MOTOR_ACCELERATION 0
#define DCD_MOTOR_FORCE 1
#define DCD_FRICTION_SIMPLIFIED 0
#define DCD_FRICTION_COULOMB 1
#define DCD_FIELD_POSE 0
#define DCD_FIELD_VELOCITY 1
#define DCD_FIELD_USER_DATA 2
#define DCD_FIELD_FORCE 3
#define DCD_FIELD_TARGET 4
#define DCD_DRAW_SHAPES 1
#define DCD_DRAW_AABBS 2
#define DCD_DRAW_SWEPT_AABBS 4
#define DCD_DRAW_CENTRES_OF_MASS 8
#define DCD_DRAW_BORDERS 16
#define DCD_DRAW_GHOSTS 32
#define DCD_DRAW_CONTACTS 64
#define DCD_DRAW_JOINTS 128
#define DCD_DRAW_VELOCITIES 256
#define DCD_DRAW_AVATARS 512
#define DCD_DRAW_LABELS 1024
#define DCD_DRAW_ALL 2047
#define DCD_DRAWN_BOX 0
#define DCD_DRAWN_SPHERE 1
#define DCD_DRAWN_CAPSULE 2
#define DCD_DRAWN_CYLINDER 3
#define DCD_DRAWN_CONE 4
#define DCD_DRAWN_HALF_SPACE 5
#define DCD_DRAWN_MESH 6
#define DCD_CONNECTION_CAME 1
#define DCD_CONNECTION_LOST 2
#define DCD_CONNECTION_BACK 3
#define DCD_CONNECTION_GONE 4
#define DCD_CAUSE_NONE 0
#define DCD_CAUSE_LEFT 1
#define DCD_CAUSE_SENT_AWAY 2
#define DCD_CAUSE_BROKEN 3
#define DCD_CAUSE_REFUSED 4
#define DCD_CAUSE_WORLD_ENDED 5
#define DCD_CAUSE_REPLACED 6
#define DCD_CAUSE_SLOW 7
#define DCD_CAUSE_UNNEEDED 8
#define DCD_CAUSE_FAILED 9
#define DCD_MEET_PUSH 0
#define DCD_MEET_TOUCH 1
#define DCD_MEET_NOT 2
#define DCD_FIDELITY_DEFAULT 0
#define DCD_FIDELITY_OFF 1
#define DCD_FIDELITY_AUTO 2
#define DCD_FIDELITY_TOLERANCE 3
#define DCD_FIDELITY_BUDGET 4
#ifdef __cplusplus
extern "C" {
#endif
DCD_API uint32_t dcd_version(void);
DCD_API const char *dcd_version_string(void);
DCD_API const char *dcd_status_string(DcdStatus status);
DCD_API
const char *dcd_refused_string(uint32_t reason);
DCD_API size_t dcd_last_error(char *buf, size_t cap);
DCD_API
DcdStatus dcd_log_set(DcdLogFn function,
                      void *user,
                      DcdLogLevel most);
DCD_API DcdStatus dcd_bug_set(DcdBugFn function, void *context);
DCD_API DcdStatus dcd_allocator_set(DcdAllocateFn allocate, DcdFreeFn free, void *context);
DCD_API DcdStatus dcd_world_create(const DcdWorldDef *def, DcdWorld *out);
DCD_API
DcdStatus dcd_world_open_scene(const char *name_or_path,
                               const char *const *params,
                               size_t param_count,
                               const DcdWorldDef *def,
                               DcdWorld *out);
DCD_API
DcdStatus dcd_world_destroy(DcdWorld world);
DCD_API bool dcd_world_is_valid(DcdWorld world);
DCD_API DcdStatus dcd_world_info(DcdWorld world, DcdWorldInfo *out);
DCD_API
DcdStatus dcd_client_connect(const DcdClientDef *def,
                             DcdWorld *out);
DCD_API DcdStatus dcd_participant_join(const DcdParticipantDef *def, DcdWorld *out);
DCD_API DcdStatus dcd_own_avatars(DcdWorld world, DcdBodyId *out, size_t cap, size_t *count);
DCD_API DcdStatus dcd_server_create(const DcdServerDef *def, DcdWorld *out);
DCD_API DcdStatus dcd_server_suspend(DcdWorld world);
DCD_API
DcdStatus dcd_token_create(DcdWorld world,
                           DcdRole role,
                           uint32_t valid_seconds,
                           char *buf,
                           size_t cap,
                           size_t *needed);
DCD_API DcdStatus dcd_address(DcdWorld world, char *buf, size_t cap, size_t *needed);
DCD_API DcdStatus dcd_metrics_address(DcdWorld world, char *buf, size_t cap, size_t *needed);
DCD_API
DcdStatus dcd_node_join(const DcdNodeDef *def,
                        DcdWorld *out);
DCD_API DcdStatus dcd_shape_box(DcdWorld world, const float *half, DcdShapeId *out);
DCD_API DcdStatus dcd_shape_sphere(DcdWorld world, float radius, DcdShapeId *out);
DCD_API DcdStatus dcd_shape_capsule(DcdWorld world, float half_height, float radius, DcdShapeId *out);
DCD_API DcdStatus dcd_shape_cylinder(DcdWorld world, float half_height, float radius, DcdShapeId *out);
DCD_API DcdStatus dcd_shape_cone(DcdWorld world, float half_height, float radius, DcdShapeId *out);
DCD_API
DcdStatus dcd_shape_hull(DcdWorld world,
                         const float *xyz,
                         size_t count,
                         DcdShapeId *out);
DCD_API
DcdStatus dcd_shape_mesh(DcdWorld world,
                         const float *xyz,
                         size_t vertex_count,
                         const uint32_t *indices,
                         size_t triangle_count,
                         bool one_sided,
                         DcdShapeId *out);
DCD_API
DcdStatus dcd_shape_heightfield(DcdWorld world,
                                const float *heights,
                                size_t rows,
                                size_t columns,
                                const float *scale,
                                DcdShapeId *out);
DCD_API DcdStatus dcd_shape_half_space(DcdWorld world, const float *normal, DcdShapeId *out);
DCD_API
DcdStatus dcd_shape_segment(DcdWorld world,
                            const float *a,
                            const float *b,
                            DcdShapeId *out);
DCD_API
DcdStatus dcd_shape_round(DcdWorld world,
                          DcdShapeId shape,
                          float border,
                          DcdShapeId *out);
DCD_API
DcdStatus dcd_shape_compound(DcdWorld world,
                             const DcdShapeId *parts,
                             const DcdFrame *frames,
                             size_t count,
                             DcdShapeId *out);
DCD_API DcdStatus dcd_shape_scale(DcdWorld world, DcdShapeId shape, const float *scale, DcdShapeId *out);
DCD_API DcdStatus dcd_shape_destroy(DcdWorld world, DcdShapeId shape);
DCD_API DcdStatus dcd_body_create(DcdWorld world, const DcdBodyDef *def, DcdBodyId *out);
DCD_API
DcdStatus dcd_bodies_create(DcdWorld world,
                            const DcdBodyDef *defs,
                            size_t count,
                            DcdBodyId *out);
DCD_API DcdStatus dcd_bodies_destroy(DcdWorld world, const DcdBodyId *bodies, size_t count);
DCD_API DcdStatus dcd_body_destroy(DcdWorld world, DcdBodyId body);
DCD_API bool dcd_body_is_valid(DcdWorld world, DcdBodyId body);
DCD_API DcdStatus dcd_body_at(DcdWorld world, uint32_t index, DcdBodyId *out);
DCD_API
DcdStatus dcd_character_create(DcdWorld world,
                               const DcdBodyDef *body,
                               const DcdCharacterDef *character,
                               DcdBodyId *out);
DCD_API
DcdStatus dcd_vehicle_create(DcdWorld world,
                             const DcdBodyDef *body,
                             const DcdVehicleDef *vehicle,
                             DcdBodyId *out);
DCD_API
DcdStatus dcd_vehicle_drive(DcdWorld world,
                            DcdBodyId vehicle,
                            const DcdDrive *drive);
DCD_API DcdStatus dcd_character_state(DcdWorld world, DcdBodyId character, DcdCharacterState *out);
DCD_API
DcdStatus dcd_vehicle_wheels(DcdWorld world,
                             DcdBodyId vehicle,
                             DcdWheelState *out,
                             size_t cap,
                             size_t *count);
DCD_API DcdStatus dcd_body_info(DcdWorld world, DcdBodyId body, DcdBodyInfo *out);
DCD_API DcdStatus dcd_body_get(DcdWorld world, DcdBodyId body, DcdPose *pose, DcdVelocity *velocity);
DCD_API DcdStatus dcd_pose_interpolate(const DcdPose *from, const DcdPose *to, double t, DcdPose *out);
DCD_API DcdStatus dcd_body_set_pose(DcdWorld world, DcdBodyId body, const DcdPose *pose);
DCD_API DcdStatus dcd_body_set_velocity(DcdWorld world, DcdBodyId body, const DcdVelocity *velocity);
DCD_API DcdStatus dcd_body_set_target(DcdWorld world, DcdBodyId body, const DcdPose *pose);
DCD_API DcdStatus dcd_body_wake(DcdWorld world, DcdBodyId body);
DCD_API DcdStatus dcd_body_sleep(DcdWorld world, DcdBodyId body);
DCD_API
DcdStatus dcd_body_apply_impulse(DcdWorld world,
                                 DcdBodyId body,
                                 const float *impulse,
                                 const double *point);
DCD_API DcdStatus dcd_body_apply_torque_impulse(DcdWorld world, DcdBodyId body, const float *impulse);
DCD_API DcdStatus dcd_body_set_force(DcdWorld world, DcdBodyId body, const float *force, const float *torque);
DCD_API DcdStatus dcd_body_add_force(DcdWorld world, DcdBodyId body, const float *force, const double *point);
DCD_API DcdStatus dcd_explode(DcdWorld world, const DcdExplosion *explosion, size_t *pushed);
DCD_API
DcdStatus dcd_flow(DcdWorld world,
                   const DcdFluid *fluid,
                   size_t *pushed);
DCD_API
DcdStatus dcd_sensor_bodies(DcdWorld world,
                            DcdBodyId body,
                            uint32_t collider,
                            DcdBodyId *out,
                            size_t cap,
                            size_t *count);
DCD_API DcdStatus dcd_body_properties(DcdWorld world, DcdBodyId body, DcdBodyProperties *out);
DCD_API
DcdStatus dcd_body_set_properties(DcdWorld world,
                                  DcdBodyId body,
                                  const DcdBodyProperties *properties);
DCD_API
DcdStatus dcd_collider_properties(DcdWorld world,
                                  DcdBodyId body,
                                  uint32_t collider,
                                  DcdColliderProperties *out);
DCD_API
DcdStatus dcd_collider_set_properties(DcdWorld world,
                                      DcdBodyId body,
                                      uint32_t collider,
                                      const DcdColliderProperties *properties);
DCD_API
DcdStatus dcd_collider_add(DcdWorld world,
                           DcdBodyId body,
                           DcdShapeId shape,
                           const DcdColliderProperties *properties,
                           uint32_t *out);
DCD_API DcdStatus dcd_collider_remove(DcdWorld world, DcdBodyId body, uint32_t collider);
DCD_API
DcdStatus dcd_collider_set_shape(DcdWorld world,
                                 DcdBodyId body,
                                 uint32_t collider,
                                 DcdShapeId shape);
DCD_API
DcdStatus dcd_body_set_events(DcdWorld world,
                              DcdBodyId body,
                              uint32_t collider,
                              uint32_t events,
                              float force_threshold);
DCD_API
DcdStatus dcd_body_set_material(DcdWorld world,
                                DcdBodyId body,
                                uint32_t collider,
                                float friction,
                                float restitution);
DCD_API
DcdStatus dcd_body_set_groups(DcdWorld world,
                              DcdBodyId body,
                              uint32_t collider,
                              uint32_t groups,
                              uint32_t mask);
DCD_API DcdStatus dcd_shape_info(DcdWorld world, DcdShapeId shape, DcdShapeInfo *out);
DCD_API DcdStatus dcd_shape_vertices(DcdWorld world, DcdShapeId shape, float *xyz, size_t cap, size_t *count);
DCD_API
DcdStatus dcd_shape_triangles(DcdWorld world,
                              DcdShapeId shape,
                              uint32_t *indices,
                              size_t cap,
                              size_t *count);
DCD_API
DcdStatus dcd_shape_heights(DcdWorld world,
                            DcdShapeId shape,
                            float *heights,
                            size_t cap,
                            size_t *count);
DCD_API
DcdStatus dcd_bodies(DcdWorld world,
                     DcdBodyId *out,
                     size_t cap,
                     size_t *count);
DCD_API DcdStatus dcd_body_extent(DcdWorld world, DcdBodyId body, DcdBodyExtent *out);
DCD_API DcdStatus dcd_collider_shape(DcdWorld world, DcdBodyId body, uint32_t collider, DcdShapeId *out);
DCD_API
DcdStatus dcd_shape_part(DcdWorld world,
                         DcdShapeId shape,
                         uint32_t part,
                         DcdShapeId *out,
                         DcdFrame *frame);
DCD_API
DcdStatus dcd_joint_create(DcdWorld world,
                           const DcdJointDef *def,
                           DcdJointId *out);
DCD_API DcdStatus dcd_joint_destroy(DcdWorld world, DcdJointId joint);
DCD_API bool dcd_joint_is_valid(DcdWorld world, DcdJointId joint);
DCD_API DcdStatus dcd_joint_info(DcdWorld world, DcdJointId joint, DcdJointInfo *out);
DCD_API
DcdStatus dcd_joint_set_limit(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              const float *limit);
DCD_API
DcdStatus dcd_joint_set_motor(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              const DcdJointMotor *motor);
DCD_API
DcdStatus dcd_joint_get_limit(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              float *out);
DCD_API
DcdStatus dcd_joint_get_motor(DcdWorld world,
                              DcdJointId joint,
                              DcdJointAxis axis,
                              DcdJointMotor *out);
DCD_API
DcdStatus dcd_joint_set_frames(DcdWorld world,
                               DcdJointId joint,
                               const DcdFrame *frame_a,
                               const DcdFrame *frame_b);
DCD_API DcdStatus dcd_joint_set_flags(DcdWorld world, DcdJointId joint, uint32_t flags);
DCD_API
DcdStatus dcd_joint_set_softness(DcdWorld world,
                                 DcdJointId joint,
                                 float natural_frequency,
                                 float damping_ratio);
DCD_API
DcdStatus dcd_body_joints(DcdWorld world,
                          DcdBodyId body,
                          DcdJointId *out,
                          size_t cap,
                          size_t *count);
DCD_API
DcdStatus dcd_joint_set_strength(DcdWorld world,
                                 DcdJointId joint,
                                 float force,
                                 float torque);
DCD_API DcdStatus dcd_step(DcdWorld world);
DCD_API DcdStatus dcd_step_begin(DcdWorld world);
DCD_API DcdStatus dcd_step_wait(DcdWorld world, uint64_t timeout_ns);
DCD_API
DcdStatus dcd_tasks_set(DcdWorld world,
                        const DcdTasks *tasks);
DCD_API DcdStatus dcd_settings(DcdWorld world, DcdSettings *out);
DCD_API DcdStatus dcd_settings_set(DcdWorld world, const DcdSettings *settings);
DCD_API DcdStatus dcd_gravity_set(DcdWorld world, const float *gravity);
DCD_API
DcdStatus dcd_state_view(DcdWorld world,
                         DcdStateView *out);
DCD_API
DcdStatus dcd_state_read(DcdWorld world,
                         const DcdBodyId *bodies,
                         size_t count,
                         DcdField field,
                         void *dst,
                         size_t stride,
                         DcdStatus *each);
DCD_API
DcdStatus dcd_state_write(DcdWorld world,
                          const DcdBodyId *bodies,
                          size_t count,
                          DcdField field,
                          const void *src,
                          size_t stride,
                          DcdStatus *each);
DCD_API
DcdStatus dcd_view_time(DcdWorld world,
                        DcdViewTime *out);
DCD_API
DcdStatus dcd_view_body(DcdWorld world,
                        DcdBodyId body,
                        double tick,
                        DcdPose *pose,
                        DcdVelocity *velocity);
DCD_API
DcdStatus dcd_view_state(DcdWorld world,
                         const DcdViewTime *time,
                         DcdStateView *out);
DCD_API DcdStatus dcd_debug_draw(DcdWorld world, const DcdViewTime *time, const DcdDebugDraw *draw);
DCD_API
DcdStatus dcd_gltf_save_file(DcdWorld world,
                             const char *path);
DCD_API DcdStatus dcd_prediction_set(DcdWorld world, bool predicts);
DCD_API DcdStatus dcd_prediction(DcdWorld world, DcdPrediction *out);
DCD_API DcdStatus dcd_connections(DcdWorld world, DcdConnectionId *out, size_t cap, size_t *count);
DCD_API DcdStatus dcd_connection_info(DcdWorld world, DcdConnectionId connection, DcdConnectionInfo *out);
DCD_API DcdStatus dcd_disconnect(DcdWorld world, DcdConnectionId connection, const char *reason);
DCD_API
DcdStatus dcd_poll(DcdWorld world,
                   uint32_t timeout_ms);
DCD_API
DcdStatus dcd_send(DcdWorld world,
                   DcdConnectionId connection,
                   const void *data,
                   size_t size,
                   uint32_t flags);
DCD_API DcdStatus dcd_events(DcdWorld world, DcdEventView *out);
DCD_API
DcdStatus dcd_body_contacts(DcdWorld world,
                            DcdBodyId body,
                            DcdContactPoint *out,
                            size_t cap,
                            size_t *count);
DCD_API
DcdStatus dcd_hooks_set(DcdWorld world,
                        const DcdHooks *hooks);
DCD_API
DcdStatus dcd_cast_rays(DcdWorld world,
                        const DcdRay *rays,
                        size_t count,
                        const DcdFilter *filter,
                        DcdRayHit *hits);
DCD_API
DcdStatus dcd_cast_rays_all(DcdWorld world,
                            const DcdRay *rays,
                            size_t count,
                            const DcdFilter *filter,
                            DcdRayHit *hits,
                            size_t cap,
                            size_t *ends,
                            size_t *total);
DCD_API
DcdStatus dcd_cast_shapes(DcdWorld world,
                          const DcdShapeCast *casts,
                          size_t count,
                          const DcdFilter *filter,
                          DcdShapeHit *hits);
DCD_API
DcdStatus dcd_project_points(DcdWorld world,
                             const DcdPointQuery *points,
                             size_t count,
                             const DcdFilter *filter,
                             DcdPointHit *hits);
DCD_API
DcdStatus dcd_overlap_shapes(DcdWorld world,
                             const DcdShapeQuery *shapes,
                             size_t count,
                             const DcdFilter *filter,
                             DcdOverlap *found,
                             size_t cap,
                             size_t *ends,
                             size_t *total);
DCD_API
DcdStatus dcd_overlap_points(DcdWorld world,
                             const DcdPointQuery *points,
                             size_t count,
                             const DcdFilter *filter,
                             DcdOverlap *found,
                             size_t cap,
                             size_t *ends,
                             size_t *total);
DCD_API
DcdStatus dcd_overlap_boxes(DcdWorld world,
                            const DcdBoxQuery *boxes,
                            size_t count,
                            const DcdFilter *filter,
                            DcdOverlap *found,
                            size_t cap,
                            size_t *ends,
                            size_t *total);
DCD_API
DcdStatus dcd_cast_ray_each(DcdWorld world,
                            const DcdRay *ray,
                            const DcdFilter *filter,
                            DcdRayFn function,
                            void *context);
DCD_API
DcdStatus dcd_cast_shape_each(DcdWorld world,
                              const DcdShapeCast *cast,
                              const DcdFilter *filter,
                              DcdShapeCastFn function,
                              void *context);
DCD_API
DcdStatus dcd_overlap_shape_each(DcdWorld world,
                                 const DcdShapeQuery *shape,
                                 const DcdFilter *filter,
                                 DcdOverlapFn function,
                                 void *context);
DCD_API
DcdStatus dcd_overlap_box_each(DcdWorld world,
                               const DcdBoxQuery *box,
                               const DcdFilter *filter,
                               DcdOverlapFn function,
                               void *context);
DCD_API
DcdStatus dcd_cast_rays_submit(DcdWorld world,
                               const DcdRay *rays,
                               size_t count,
                               const DcdFilter *filter,
                               DcdQueryId *out);
DCD_API
DcdStatus dcd_cast_shapes_submit(DcdWorld world,
                                 const DcdShapeCast *casts,
                                 size_t count,
                                 const DcdFilter *filter,
                                 DcdQueryId *out);
DCD_API
DcdStatus dcd_overlap_shapes_submit(DcdWorld world,
                                    const DcdShapeQuery *shapes,
                                    size_t count,
                                    const DcdFilter *filter,
                                    DcdQueryId *out);
DCD_API
DcdStatus dcd_overlap_points_submit(DcdWorld world,
                                    const DcdPointQuery *points,
                                    size_t count,
                                    const DcdFilter *filter,
                                    DcdQueryId *out);
DCD_API
DcdStatus dcd_overlap_boxes_submit(DcdWorld world,
                                   const DcdBoxQuery *boxes,
                                   size_t count,
                                   const DcdFilter *filter,
                                   DcdQueryId *out);
DCD_API
DcdStatus dcd_query_poll(DcdWorld world,
                         DcdQueryId query,
                         DcdRayHit *hits,
                         size_t cap,
                         size_t *count);
DCD_API
DcdStatus dcd_query_poll_casts(DcdWorld world,
                               DcdQueryId query,
                               DcdShapeHit *hits,
                               size_t cap,
                               size_t *count);
DCD_API
DcdStatus dcd_query_poll_overlaps(DcdWorld world,
                                  DcdQueryId query,
                                  DcdOverlap *found,
                                  size_t cap,
                                  size_t *ends,
                                  size_t *total);
DCD_API DcdStatus dcd_query_cancel(DcdWorld world, DcdQueryId query);
DCD_API DcdStatus dcd_regions(DcdWorld world, DcdRegionInfo *out, size_t cap, size_t *count);
DCD_API
DcdStatus dcd_borders(DcdWorld world,
                      DcdBorderInfo *out,
                      size_t cap,
                      size_t *count);
DCD_API
DcdStatus dcd_body_owner(DcdWorld world,
                         DcdBodyId body,
                         DcdOwner *out);
DCD_API
DcdStatus dcd_interest_set(DcdWorld world,
                           const double *centre,
                           double radius);
DCD_API
DcdStatus dcd_bandwidth_set(DcdWorld world,
                            uint32_t bytes_per_second);
DCD_API DcdStatus dcd_stats(DcdWorld world, DcdStats *out);
DCD_API DcdStatus dcd_stats_text(DcdWorld world, char *buf, size_t cap, size_t *needed);
DCD_API
DcdStatus dcd_validate(DcdWorld world,
                       char *buf,
                       size_t cap,
                       size_t *needed);
DCD_API DcdStatus dcd_state_hash(DcdWorld world, uint64_t *out);
DCD_API DcdStatus dcd_profile(DcdWorld world, DcdProfile *out);
DCD_API
DcdStatus dcd_checkpoint_create(DcdWorld world,
                                DcdCheckpointId *out);
DCD_API
DcdStatus dcd_checkpoint_save(DcdWorld world,
                              DcdCheckpointId checkpoint);
DCD_API DcdStatus dcd_checkpoint_restore(DcdWorld world, DcdCheckpointId checkpoint);
DCD_API DcdStatus dcd_checkpoint_destroy(DcdWorld world, DcdCheckpointId checkpoint);
DCD_API
DcdStatus dcd_viewpoints_set(DcdWorld world,
                             const DcdViewpoint *viewpoints,
                             size_t count);
DCD_API DcdStatus dcd_fidelity_report(DcdWorld world, DcdFidelityReport *out);
DCD_API
DcdStatus dcd_record(DcdWorld world,
                     const char *path);
DCD_API
DcdStatus dcd_record_last(DcdWorld world,
                          float seconds);
DCD_API DcdStatus dcd_record_keep(DcdWorld world, const char *path);
DCD_API DcdStatus dcd_record_stop(DcdWorld world);
DCD_API DcdStatus dcd_snapshot_save(DcdWorld world, void *buf, size_t cap, size_t *needed);
DCD_API
DcdStatus dcd_snapshot_save_file(DcdWorld world,
                                 const char *path);
DCD_API
DcdStatus dcd_snapshot_load(DcdWorld world,
                            const void *data,
                            size_t size);
DCD_API DcdStatus dcd_snapshot_load_file(DcdWorld world, const char *path);
#ifdef __cplusplus
}
#endif
#define DCD_WORLD_DEF_INIT \
    { (uint32_t)sizeof(DcdWorldDef), 0, 0, 4, { 0.0f, -9.81f, 0.0f }, 1.0f / 60.0f, \
      { -64.0, -64.0, -64.0 }, { 64.0, 64.0, 64.0 }, 0, 0, 0, 0, 0, 0, 0.0f, 0, 0.0f, 0, 0.0f, NULL, 0, 0 }
#define DCD_BODY_DEF_INIT \
    { (uint32_t)sizeof(DcdBodyDef), DCD_DYNAMIC, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f } }, { 0 }, 1000.0f, 0.0f, 0.5f, 0.0f, 0, 0, 0.0f, \
      0.0f, 0.0f, 1.0f, 0, 0, 0, 0.0f, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 7, 0, 0.0f, \
      0.05f, 0.5f, 0.5f, 0.0f, { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, 0, 0, 0, 0, 0 }
#define DCD_CHARACTER_DEF_INIT \
    { (uint32_t)sizeof(DcdCharacterDef), 0.3f, 0.1f, 0.785398163f, 0.785398163f, 0.2f, 0.02f, 80.0f, 0 }
#define DCD_WHEEL_INIT \
    { { 0.0f, 0.0f, 0.0f }, { 0.0f, -1.0f, 0.0f }, { 0.0f, 0.0f, 1.0f }, 0.3f, 0.2f, 0.35f, 30.0f, 4.0f, 5.0f, 20000.0f, \
      1.5f, 1.0f, 0.0f, 4000.0f, 0.0f }
#define DCD_VEHICLE_DEF_INIT \
    { (uint32_t)sizeof(DcdVehicleDef), 0, NULL, 20.0f, 0 }
#define DCD_EXPLOSION_INIT \
    { (uint32_t)sizeof(DcdExplosion), 0xFFFFFFFFu, { 0.0, 0.0, 0.0 }, 5.0f, 5.0f, 100.0f, 0 }
#define DCD_FLUID_INIT \
    { (uint32_t)sizeof(DcdFluid), 0xFFFFFFFFu, { -1.0e9, -1.0e9, -1.0e9 }, { 1.0e9, 1.0e9, 1.0e9 }, 0.0, 1000.0f, \
      { 0.0f, 0.0f, 0.0f }, 1.0f, 1.0f, 0.0f, 0 }
#define DCD_COLLIDER_PROPERTIES_INIT \
    { (uint32_t)sizeof(DcdColliderProperties), 0, { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \
      1000.0f, 0.0f, 0.5f, 0.0f, 0, 0, 0.0f, 0, 0.0f, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu, 7, 0, 0 }
#define DCD_JOINT_MOTOR_INIT { 0.0f, 0.0f, 0.0f, 1000.0f, 3.402823466e+38f, DCD_MOTOR_ACCELERATION }
#define DCD_JOINT_DEF_INIT \
    { (uint32_t)sizeof(DcdJointDef), DCD_JOINT_FIXED, { 0 }, { 0 }, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, \
      { { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0.0f, 0.0f }, DCD_JOINT_MOTOR_INIT, \
      0, 0, 0, 1.0e6f, 1.0f, 0, 0 }
#define DCD_FILTER_INIT { (uint32_t)sizeof(DcdFilter), 0, 0, 0xFFFFFFFFu, NULL, 0 }
#define DCD_RAY_INIT { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f }, 1.0e6f, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_SHAPE_CAST_INIT \
    { { 0 }, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0.0f, 0.0f, 0.0f }, { 0.0f, 0.0f, 0.0f }, \
      0.0f, 0xFFFFFFFFu, { 0 }, 0, 0 }
#define DCD_POINT_QUERY_INIT { { 0.0, 0.0, 0.0 }, 1.0e6f, 0xFFFFFFFFu, { 0 }, 0, 0 }
#define DCD_SHAPE_QUERY_INIT \
    { { 0 }, { { 0.0, 0.0, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } }, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_BOX_QUERY_INIT { { 0.0, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }, { 0 }, 0xFFFFFFFFu, 0 }
#define DCD_DEBUG_DRAW_INIT \
    { (uint32_t)sizeof(DcdDebugDraw), DCD_DRAW_SHAPES, NULL, NULL, NULL, NULL, NULL, NULL, \
      { -1.0e300, -1.0e300, -1.0e300 }, { 1.0e300, 1.0e300, 1.0e300 }, 0.1f, 1.0e-4f }
#define DCD_CLIENT_DEF_INIT \
    { (uint32_t)sizeof(DcdClientDef), 10000, NULL, NULL, NULL, 0, { 0.0, 0.0, 0.0 }, 0.0, 0, 0 }
#define DCD_PARTICIPANT_DEF_INIT \
    { (uint32_t)sizeof(DcdParticipantDef), 10000, NULL, NULL, NULL, 0, 0, 0, { 0.0, 0.0, 0.0 }, 0.0, NULL, NULL }
#define DCD_GROUP_DEF_INIT \
    { (uint32_t)sizeof(DcdGroupDef), 0, 0.0f, 0.0f, 0.1f, 32 }
#define DCD_SERVER_DEF_INIT \
    { (uint32_t)sizeof(DcdServerDef), 1, NULL, NULL, 0, NULL, { 0 }, NULL, "127.0.0.1:0", NULL, 0, \
      20.0f, 0, 0, 3, 0.0f, NULL, NULL, NULL, 3600.0f, 0 }
#define DCD_NODE_DEF_INIT \
    { (uint32_t)sizeof(DcdNodeDef), 10000, NULL, NULL, NULL, NULL, 0, 0, 0, NULL, NULL, NULL }
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
static inline DcdStatus dcd_version_check(void)
{
    return dcd_version() / 1000u == DCD_VERSION / 1000u ? DCD_OK : DCD_ERR_VERSION;
}
#if UINTPTR_MAX == 0xFFFFFFFFFFFFFFFFu
#ifdef __cplusplus
#define DCD_ASSERT_(what) static_assert(what, #what)
#else
#define DCD_ASSERT_(what) _Static_assert(what, #what)
#endif
#undef DCD_ASSERT_
#endif
#endif
