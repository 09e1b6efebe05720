/* dcd for C++17 and later: dcd.h with handles that clean up, results in place of output pointers, and views in place of pointer and
 * length. Header only: it links to the same library and needs nothing else.
 *
 * Names. Each function of dcd.h is here by its name without dcd_, and dcd.h documents it. A function that takes a world is a member of
 * dcd::World, a function that makes a world is a static member of it, and the rest are free functions. So
 * dcd_body_create(world, &def, &id) is world.body_create(def). Types are those of dcd.h without Dcd. Constants keep their names, such as
 * DCD_DYNAMIC.
 *
 * Errors. A function that may fail returns a Status, or a Result<T>, which holds a value or a Status. Both are false when the call
 * failed, and neither may be dropped. With DCD_EXCEPTIONS defined before the header, a call that fails throws dcd::Error instead. Then
 * what is returned is always good, and a Status may be dropped. Programs may mix files of both kinds.
 *
 *     dcd::Result<dcd::World> world = dcd::World::create();
 *     if (!world) { report(world.status().code(), world.status().message()); }
 *     dcd::Status stepped = world->step();
 *
 * Lifetimes. A World destroys the world that it made, an Owned its one body, shape or joint. Both move and do not copy. Ids are numbers:
 * they copy, compare and hash, and an id whose thing is gone gives DCD_ERR_STALE_ID. What state_view and events lend lives as long as
 * dcd.h says.
 *
 * Threads. As in dcd.h, any thread may call any function of a world. Moving, resetting or destroying a World object is like writing any
 * other object: no other thread may use that object meanwhile.
 */
#ifndef DCD_HPP
#define DCD_HPP

#if !defined(_MSC_VER) && __cplusplus < 201703L
#error "dcd.hpp needs C++17: compile with -std=c++17 or later"
#endif

#include "dcd.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#ifdef DCD_EXCEPTIONS
#include <stdexcept>
#define DCD_NODISCARD_
#else
#define DCD_NODISCARD_ [[nodiscard]]
#endif

/* Ids compare by what they name. Ids of different kinds do not compare. */
#define DCD_ID_(Id) \
    constexpr bool operator==(Id a, Id b) noexcept { return a.v == b.v; } \
    constexpr bool operator!=(Id a, Id b) noexcept { return a.v != b.v; } \
    constexpr bool operator<(Id a, Id b) noexcept { return a.v < b.v; } \
    template <> struct std::hash<Id> { \
        std::size_t operator()(Id id) const noexcept { return std::hash<std::uint64_t>()(id.v); } \
    };
DCD_ID_(DcdBodyId)
DCD_ID_(DcdShapeId)
DCD_ID_(DcdJointId)
DCD_ID_(DcdCheckpointId)
DCD_ID_(DcdQueryId)
DCD_ID_(DcdConnectionId)
#undef DCD_ID_

namespace dcd {

using BodyId = DcdBodyId;
using ShapeId = DcdShapeId;
using JointId = DcdJointId;
using CheckpointId = DcdCheckpointId;
using QueryId = DcdQueryId;
using ConnectionId = DcdConnectionId;
using Pose = DcdPose;
using Velocity = DcdVelocity;
using Drive = DcdDrive;
using Ground = DcdGround;
using WheelState = DcdWheelState;
using Cut = DcdCut;
using ViewTime = DcdViewTime;
using DrawnShape = DcdDrawnShape;
using Frame = DcdFrame;
using Contact = DcdContact;
using ContactForce = DcdContactForce;
using ContactPoint = DcdContactPoint;
using JointOverload = DcdJointOverload;
using HookedPair = DcdHookedPair;
using HookedContact = DcdHookedContact;
using Transfer = DcdTransfer;
using BodyChange = DcdBodyChange;
using ConnectionEvent = DcdConnectionEvent;
using Message = DcdMessage;
using RayHit = DcdRayHit;
using RegionInfo = DcdRegionInfo;
using Viewpoint = DcdViewpoint;
using BorderInfo = DcdBorderInfo;
using ShapeHit = DcdShapeHit;
using PointHit = DcdPointHit;
using Overlap = DcdOverlap;
using Force = DcdForce;

/* Three numbers x, y, z: a direction, a size, a force. */
using Vec3 = std::array<float, 3>;
/* Point x, y, z in world space, metres. */
using Point = std::array<double, 3>;

/* Structs that functions read or fill. They start with the values of their _INIT macro. They add no member to those of dcd.h, so an array
 * of the one is an array of the other. */
#define DCD_STRUCT_(Name, INIT) \
    struct Name : Dcd##Name { \
        Name() noexcept : Dcd##Name INIT {} \
    }; \
    static_assert(sizeof(Name) == sizeof(Dcd##Name), "no member is added")
DCD_STRUCT_(WorldDef, DCD_WORLD_DEF_INIT);
DCD_STRUCT_(ClientDef, DCD_CLIENT_DEF_INIT);
DCD_STRUCT_(ParticipantDef, DCD_PARTICIPANT_DEF_INIT);
DCD_STRUCT_(GroupDef, DCD_GROUP_DEF_INIT);
DCD_STRUCT_(ServerDef, DCD_SERVER_DEF_INIT);
DCD_STRUCT_(NodeDef, DCD_NODE_DEF_INIT);
DCD_STRUCT_(BodyDef, DCD_BODY_DEF_INIT);
DCD_STRUCT_(CharacterDef, DCD_CHARACTER_DEF_INIT);
DCD_STRUCT_(Wheel, DCD_WHEEL_INIT);
DCD_STRUCT_(VehicleDef, DCD_VEHICLE_DEF_INIT);
DCD_STRUCT_(CharacterState, DCD_CHARACTER_STATE_INIT);
DCD_STRUCT_(BodyProperties, DCD_BODY_PROPERTIES_INIT);
DCD_STRUCT_(ColliderProperties, DCD_COLLIDER_PROPERTIES_INIT);
DCD_STRUCT_(JointMotor, DCD_JOINT_MOTOR_INIT);
DCD_STRUCT_(JointInfo, DCD_JOINT_INFO_INIT);
DCD_STRUCT_(Filter, DCD_FILTER_INIT);
DCD_STRUCT_(Ray, DCD_RAY_INIT);
DCD_STRUCT_(ShapeCast, DCD_SHAPE_CAST_INIT);
DCD_STRUCT_(PointQuery, DCD_POINT_QUERY_INIT);
DCD_STRUCT_(ShapeQuery, DCD_SHAPE_QUERY_INIT);
DCD_STRUCT_(BoxQuery, DCD_BOX_QUERY_INIT);
DCD_STRUCT_(JointDef, DCD_JOINT_DEF_INIT);
DCD_STRUCT_(WorldInfo, DCD_WORLD_INFO_INIT);
DCD_STRUCT_(BodyInfo, DCD_BODY_INFO_INIT);
DCD_STRUCT_(Settings, DCD_SETTINGS_INIT);
DCD_STRUCT_(Profile, DCD_PROFILE_INIT);
DCD_STRUCT_(FidelityReport, DCD_FIDELITY_REPORT_INIT);
DCD_STRUCT_(Hooks, DCD_HOOKS_INIT);
DCD_STRUCT_(Tasks, DCD_TASKS_INIT);
DCD_STRUCT_(Explosion, DCD_EXPLOSION_INIT);
DCD_STRUCT_(Fluid, DCD_FLUID_INIT);
DCD_STRUCT_(ShapeInfo, DCD_SHAPE_INFO_INIT);
DCD_STRUCT_(BodyExtent, DCD_BODY_EXTENT_INIT);
DCD_STRUCT_(Owner, DCD_OWNER_INIT);
DCD_STRUCT_(Stats, DCD_STATS_INIT);
DCD_STRUCT_(Prediction, DCD_PREDICTION_INIT);
DCD_STRUCT_(DebugDraw, DCD_DEBUG_DRAW_INIT);
DCD_STRUCT_(ConnectionInfo, DCD_CONNECTION_INFO_INIT);
#undef DCD_STRUCT_

/* Pose and velocity of a body. */
struct Motion {
    Pose pose;
    Velocity velocity;
};

/* Items in a row that somebody else owns, as std::span is from C++20 on. It converts to std::span. */
template <class T> class Span {
public:
    constexpr Span() noexcept = default;
    constexpr Span(T *items, std::size_t count) noexcept : items_(items), count_(count) {}
    template <std::size_t N> constexpr Span(T (&items)[N]) noexcept : items_(items), count_(N) {}
    /* Makes a span of what has data() and size(): vectors, arrays, other spans. A temporary one lives until the end of the call. */
    template <class C, class = std::enable_if_t<std::is_convertible_v<decltype(std::declval<C &>().data()), T *> &&
                                                sizeof(*std::declval<C &>().data()) == sizeof(T)>>
    constexpr Span(C &&items) noexcept : items_(items.data()), count_(items.size())
    {
    }

    constexpr T *data() const noexcept { return items_; }
    constexpr std::size_t size() const noexcept { return count_; }
    constexpr bool empty() const noexcept { return count_ == 0; }
    constexpr T &operator[](std::size_t i) const noexcept { return items_[i]; }
    constexpr T *begin() const noexcept { return items_; }
    constexpr T *end() const noexcept { return items_ + count_; }

private:
    T *items_ = nullptr;
    std::size_t count_ = 0;
};

/* Answers to a batch of queries, each of which may find several things. */
template <class T> struct Found {
    std::vector<T> items;
    /* Where the answers to query i end in `items`. */
    std::vector<std::size_t> ends;
    /* Returns the answers to query i. Of a temporary Found, with which they would be gone, it returns a copy: keep that by auto, not as a
     * Span. */
    Span<const T> of(std::size_t i) const & noexcept
    {
        const std::size_t begin = i == 0 ? 0 : ends[i - 1];
        return { items.data() + begin, ends[i] - begin };
    }
    std::vector<T> of(std::size_t i) const &&
    {
        const Span<const T> kept = of(i);
        return { kept.begin(), kept.end() };
    }
};

/* Returns the message of the calling thread's last failed call: function, cause, remedy. */
inline std::string last_error()
{
    std::string text(dcd_last_error(nullptr, 0), '\0');
    dcd_last_error(text.empty() ? nullptr : &text[0], text.empty() ? 0 : text.size() + 1);
    return text;
}

/* Each of the two ways to report a failed call has a namespace, and so linker names, of its own, so that a program may mix them. */
#ifdef DCD_EXCEPTIONS
inline namespace throwing {

/* Exception of a call that failed; what() is its message. */
class Error : public std::runtime_error {
public:
    explicit Error(DcdStatus code) : std::runtime_error(last_error()), code_(code) {}
    DcdStatus code() const noexcept { return code_; }

private:
    DcdStatus code_;
};
#else
inline namespace returning {
#endif

/* Outcome of a call: whether it succeeded, and why it failed. */
class DCD_NODISCARD_ Status {
public:
    /* Makes the outcome of a function of dcd.h from the status that it returned. */
    explicit Status(DcdStatus code) : code_(code)
    {
        if (code != DCD_OK) {
#ifdef DCD_EXCEPTIONS
            throw Error(code);
#else
            message_ = last_error();
#endif
        }
    }

    explicit operator bool() const noexcept { return code_ == DCD_OK; }
    /* Returns DCD_OK or a DCD_ERR_… code. */
    DcdStatus code() const noexcept { return code_; }
    /* Returns the name of the code, such as "DCD_ERR_NULL". */
    const char *name() const noexcept { return dcd_status_string(code_); }
    /* Returns what dcd_last_error said of the failure; empty if the call succeeded. */
    const std::string &message() const noexcept { return message_; }
    /* Ends the program with the library's own message if the call failed. */
    void expect() const
    {
        if (code_ != DCD_OK) {
            std::fprintf(stderr, "%s: %s\n", name(), message_.c_str());
            std::abort();
        }
    }

private:
    DcdStatus code_;
    std::string message_;
};

/* Value that a call returned, or why it returned none. */
template <class T> class DCD_NODISCARD_ Result {
public:
    Result(Status status, T value) : status_(std::move(status)), value_(std::move(value)) {}

    explicit operator bool() const noexcept { return bool(status_); }
    Status status() const { return status_; }
    /* Returns the value. Ends the program with the library's own message if the call failed. */
    T &value() &
    {
        status_.expect();
        return value_;
    }
    const T &value() const &
    {
        status_.expect();
        return value_;
    }
    T value() &&
    {
        status_.expect();
        return std::move(value_);
    }
    T value_or(T otherwise) && { return *this ? std::move(value_) : std::move(otherwise); }
    /* Does what value() does. */
    T &operator*() & { return value(); }
    const T &operator*() const & { return value(); }
    T operator*() && { return std::move(*this).value(); }
    T *operator->() { return &value(); }
    const T *operator->() const { return &value(); }

private:
    Status status_;
    T value_;
};

/* State of every movable body after a step, as dcd_state_view lends it. Item i of each span belongs to ids()[i]. */
class StateView {
public:
    explicit StateView(const DcdStateView &view) noexcept : view_(view) {}
    std::uint64_t tick() const noexcept { return view_.tick; }
    std::size_t size() const noexcept { return view_.count; }
    Span<const BodyId> ids() const noexcept { return { view_.ids, view_.count }; }
    Span<const Pose> poses() const noexcept { return { view_.poses, view_.count }; }
    Span<const Velocity> velocities() const noexcept { return { view_.velocities, view_.count }; }
    Span<const std::uint64_t> user_data() const noexcept { return { view_.user_data, view_.count }; }
    Span<const std::uint32_t> flags() const noexcept { return { view_.flags, view_.count }; }
    Span<const std::uint32_t> regions() const noexcept { return { view_.regions, view_.count }; }
    /* Slot of each body: the index of the program's own data of it in an array of slot_count() items. It is the same in every view that
     * shows the body. */
    Span<const std::uint32_t> slots() const noexcept { return { view_.slots, view_.count }; }
    std::size_t slot_count() const noexcept { return view_.slot_count; }

private:
    DcdStateView view_;
};

/* Events of the last step, as dcd_events lends them. */
class EventView {
public:
    explicit EventView(const DcdEventView &view) noexcept : view_(view) {}
    std::uint64_t tick() const noexcept { return view_.tick; }
    /* DCD_EVENTS_… bits. */
    std::uint32_t flags() const noexcept { return view_.flags; }
    Span<const Contact> contacts() const noexcept { return { view_.contacts, view_.contact_count }; }
    Span<const ContactForce> forces() const noexcept { return { view_.forces, view_.force_count }; }
    Span<const JointOverload> overloads() const noexcept { return { view_.overloads, view_.overload_count }; }
    Span<const Transfer> transfers() const noexcept { return { view_.transfers, view_.transfer_count }; }
    Span<const BodyChange> changes() const noexcept { return { view_.changes, view_.change_count }; }
    Span<const ConnectionEvent> connections() const noexcept { return { view_.connections, view_.connection_count }; }
    Span<const Message> messages() const noexcept { return { view_.messages, view_.message_count }; }

private:
    DcdEventView view_;
};

/* World of any role. It is destroyed with this object. */
class World {
public:
    World() noexcept = default;
    World(World &&other) noexcept : world_(other.release()) {}
    World &operator=(World &&other) noexcept
    {
        DcdWorld taken = other.release();
        reset();
        world_ = taken;
        return *this;
    }
    World(const World &) = delete;
    World &operator=(const World &) = delete;
    ~World() { reset(); }

    /* Takes over a world of dcd.h. */
    explicit World(DcdWorld world) noexcept : world_(world) {}
    /* Returns the handle, for functions of dcd.h. It stays this object's. */
    DcdWorld handle() const noexcept { return world_; }
    /* Gives the handle away. The world lives on. */
    DcdWorld release() noexcept { return std::exchange(world_, DcdWorld{ 0 }); }
    /* Destroys the world now. To learn whether that went well, call dcd_world_destroy(world.release()). In a function that the library
     * calls (of a query, a hook, the log) nothing can be destroyed. Then the handle is kept, to be reset later. A destructor that runs
     * there leaves the world behind. */
    void reset() noexcept
    {
        if (world_.v != 0 && dcd_world_destroy(world_) != DCD_ERR_BUSY) {
            world_ = DcdWorld{ 0 };
        }
    }

    /* Making a world. */

    static Result<World> create(const WorldDef &def = {})
    {
        return made([&](DcdWorld *out) { return dcd_world_create(&def, out); });
    }
    static Result<World> open_scene(const char *name_or_path, Span<const char *const> params = {}, const WorldDef &def = {})
    {
        return made([&](DcdWorld *out) {
            return dcd_world_open_scene(name_or_path, params.data(), params.size(), &def, out);
        });
    }
    static Result<World> client_connect(const ClientDef &def)
    {
        return made([&](DcdWorld *out) { return dcd_client_connect(&def, out); });
    }
    static Result<World> participant_join(const ParticipantDef &def)
    {
        return made([&](DcdWorld *out) { return dcd_participant_join(&def, out); });
    }

    static Result<World> server_create(const ServerDef &def)
    {
        return made([&](DcdWorld *out) { return dcd_server_create(&def, out); });
    }
    static Result<World> node_join(const NodeDef &def)
    {
        return made([&](DcdWorld *out) { return dcd_node_join(&def, out); });
    }

    /* Letting others in. */

    Result<std::string> address() const
    {
        return text([&](char *out, std::size_t cap, std::size_t *needed) { return dcd_address(world_, out, cap, needed); });
    }
    Result<std::string> metrics_address() const
    {
        return text([&](char *out, std::size_t cap, std::size_t *needed) { return dcd_metrics_address(world_, out, cap, needed); });
    }
    Result<std::string> token_create(DcdRole role, std::uint32_t valid_seconds)
    {
        return text([&](char *out, std::size_t cap, std::size_t *needed) {
            return dcd_token_create(world_, role, valid_seconds, out, cap, needed);
        });
    }
    /* Stops a server and keeps its world. Without it, the end of this object ends the world for all. */
    Status server_suspend() { return Status(dcd_server_suspend(world_)); }

    /* The world as a whole. */

    bool is_valid() const noexcept { return dcd_world_is_valid(world_); }
    Result<WorldInfo> info() const
    {
        return got<WorldInfo>([&](WorldInfo *out) { return dcd_world_info(world_, out); });
    }
    /* Sets the functions of `hooks`. Any thread calls them, several at a time. They must not throw. */
    Status hooks_set(const Hooks &hooks) { return Status(dcd_hooks_set(world_, &hooks)); }
    Status hooks_clear() { return Status(dcd_hooks_set(world_, nullptr)); }
    Status tasks_set(const Tasks &tasks) { return Status(dcd_tasks_set(world_, &tasks)); }
    Status tasks_clear() { return Status(dcd_tasks_set(world_, nullptr)); }
    Result<Settings> settings() const
    {
        return got<Settings>([&](Settings *out) { return dcd_settings(world_, out); });
    }
    Status settings_set(const Settings &settings) { return Status(dcd_settings_set(world_, &settings)); }
    Status gravity_set(const Vec3 &gravity) { return Status(dcd_gravity_set(world_, gravity.data())); }
    Status step() { return Status(dcd_step(world_)); }
    Status step_begin() { return Status(dcd_step_begin(world_)); }
    Status step_wait(std::uint64_t timeout_ns) { return Status(dcd_step_wait(world_, timeout_ns)); }
    Result<std::vector<unsigned char>> snapshot_save() const
    {
        return listed<unsigned char>([&](unsigned char *out, std::size_t cap, std::size_t *needed) {
            return dcd_snapshot_save(world_, out, cap, needed);
        });
    }
    Status snapshot_load(Span<const unsigned char> data)
    {
        return Status(dcd_snapshot_load(world_, data.data(), data.size()));
    }
    Status snapshot_save_file(const char *path) const { return Status(dcd_snapshot_save_file(world_, path)); }
    /* Rollback: keeps a local world in memory, and goes back to it. */
    Result<DcdCheckpointId> checkpoint_create() const
    {
        return got<DcdCheckpointId>([&](DcdCheckpointId *out) { return dcd_checkpoint_create(world_, out); });
    }
    Status checkpoint_save(DcdCheckpointId checkpoint) const { return Status(dcd_checkpoint_save(world_, checkpoint)); }
    Status checkpoint_restore(DcdCheckpointId checkpoint) { return Status(dcd_checkpoint_restore(world_, checkpoint)); }
    Status checkpoint_destroy(DcdCheckpointId checkpoint) const
    {
        return Status(dcd_checkpoint_destroy(world_, checkpoint));
    }
    Status gltf_save_file(const char *path) const { return Status(dcd_gltf_save_file(world_, path)); }
    Status snapshot_load_file(const char *path) { return Status(dcd_snapshot_load_file(world_, path)); }
    Status record(const char *path) { return Status(dcd_record(world_, path)); }
    Status record_last(float seconds) { return Status(dcd_record_last(world_, seconds)); }
    Status record_keep(const char *path) { return Status(dcd_record_keep(world_, path)); }
    Status record_stop() { return Status(dcd_record_stop(world_)); }
    Result<StateView> state_view() const
    {
        DcdStateView view = DCD_STATE_VIEW_INIT;
        Status status(dcd_state_view(world_, &view));
        return { status, StateView(view) };
    }
    /* Returns the ticks to show now; view_state and view_body return how bodies are shown at them. */
    Result<ViewTime> view_time()
    {
        ViewTime time = DCD_VIEW_TIME_INIT;
        Status status(dcd_view_time(world_, &time));
        return { status, time };
    }
    Result<StateView> view_state(const ViewTime &time) const
    {
        DcdStateView view = DCD_STATE_VIEW_INIT;
        Status status(dcd_view_state(world_, &time, &view));
        return { status, StateView(view) };
    }
    /* Draws the world at a time to show, or, without one, as it is after the last step. The functions of `draw` must not throw. */
    Status debug_draw(const DebugDraw &draw, const ViewTime *time = nullptr)
    {
        return Status(dcd_debug_draw(world_, time, &draw));
    }
    Result<Pose> view_body(BodyId body, double tick, Velocity *velocity = nullptr) const
    {
        Pose pose = {};
        Status status(dcd_view_body(world_, body, tick, &pose, velocity));
        return { status, pose };
    }
    Result<EventView> events() const
    {
        DcdEventView view = DCD_EVENT_VIEW_INIT;
        Status status(dcd_events(world_, &view));
        return { status, EventView(view) };
    }
    Result<Stats> stats() const
    {
        return got<Stats>([&](Stats *out) { return dcd_stats(world_, out); });
    }
    Result<Profile> profile() const
    {
        return got<Profile>([&](Profile *out) { return dcd_profile(world_, out); });
    }
    Result<std::string> stats_text() const
    {
        return text([&](char *out, std::size_t cap, std::size_t *needed) {
            return dcd_stats_text(world_, out, cap, needed);
        });
    }
    /* Returns what does not hold in the world, one finding per line; empty as long as all is well. Local worlds only. */
    Result<std::string> validate() const
    {
        return text([&](char *out, std::size_t cap, std::size_t *needed) { return dcd_validate(world_, out, cap, needed); });
    }
    Result<std::uint64_t> state_hash() const
    {
        return got<std::uint64_t>([&](std::uint64_t *out) { return dcd_state_hash(world_, out); });
    }
    Result<std::vector<RegionInfo>> regions() const
    {
        return listed<RegionInfo>([&](RegionInfo *out, std::size_t cap, std::size_t *count) {
            return dcd_regions(world_, out, cap, count);
        });
    }
    /* Sets where the world is looked at from. Without viewpoints, all of a local world is looked at. */
    Status viewpoints_set(Span<const Viewpoint> viewpoints)
    {
        return Status(dcd_viewpoints_set(world_, viewpoints.data(), viewpoints.size()));
    }
    Result<FidelityReport> fidelity_report() const
    {
        return got<FidelityReport>([&](FidelityReport *out) { return dcd_fidelity_report(world_, out); });
    }
    Status prediction_set(bool predicts) { return Status(dcd_prediction_set(world_, predicts)); }
    Result<Prediction> prediction() const
    {
        return got<Prediction>([&](Prediction *out) { return dcd_prediction(world_, out); });
    }
    Status bandwidth_set(std::uint32_t bytes_per_second) { return Status(dcd_bandwidth_set(world_, bytes_per_second)); }
    /* Sets the area of interest. A radius of 0 is everything. */
    Status interest_set(const Point &centre, double radius) { return Status(dcd_interest_set(world_, centre.data(), radius)); }
    Result<std::vector<BorderInfo>> borders() const
    {
        return listed<BorderInfo>([&](BorderInfo *out, std::size_t cap, std::size_t *count) {
            return dcd_borders(world_, out, cap, count);
        });
    }
    Result<std::vector<BodyId>> own_avatars() const
    {
        return listed<BodyId>([&](BodyId *out, std::size_t cap, std::size_t *count) {
            return dcd_own_avatars(world_, out, cap, count);
        });
    }

    /* Other processes of a served world. */

    Result<std::vector<ConnectionId>> connections() const
    {
        return listed<ConnectionId>([&](ConnectionId *out, std::size_t cap, std::size_t *count) {
            return dcd_connections(world_, out, cap, count);
        });
    }
    Result<ConnectionInfo> connection_info(ConnectionId connection) const
    {
        return got<ConnectionInfo>([&](ConnectionInfo *out) { return dcd_connection_info(world_, connection, out); });
    }
    Status disconnect(ConnectionId connection, const char *reason = nullptr)
    {
        return Status(dcd_disconnect(world_, connection, reason));
    }
    Status poll(std::uint32_t timeout_ms) const { return Status(dcd_poll(world_, timeout_ms)); }
    Status send(ConnectionId connection, Span<const unsigned char> bytes, std::uint32_t flags = 0)
    {
        return Status(dcd_send(world_, connection, bytes.data(), bytes.size(), flags));
    }
    /* Sends a text, without a NUL at its end. */
    Status send(ConnectionId connection, std::string_view text, std::uint32_t flags = 0)
    {
        return Status(dcd_send(world_, connection, text.data(), text.size(), flags));
    }

    /* Shapes. */

    Result<ShapeId> shape_box(const Vec3 &half)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_box(world_, half.data(), out); });
    }
    Result<ShapeId> shape_sphere(float radius)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_sphere(world_, radius, out); });
    }
    Result<ShapeId> shape_capsule(float half_height, float radius)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_capsule(world_, half_height, radius, out); });
    }
    Result<ShapeId> shape_cylinder(float half_height, float radius)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_cylinder(world_, half_height, radius, out); });
    }
    Result<ShapeId> shape_cone(float half_height, float radius)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_cone(world_, half_height, radius, out); });
    }
    Result<ShapeId> shape_hull(Span<const Vec3> points)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_hull(world_, floats(points), points.size(), out); });
    }
    Result<ShapeId> shape_mesh(Span<const Vec3> vertices, Span<const std::array<std::uint32_t, 3>> triangles, bool one_sided = false)
    {
        const std::uint32_t *indices = triangles.empty() ? nullptr : triangles.data()->data();
        return got<ShapeId>([&](ShapeId *out) {
            return dcd_shape_mesh(world_, floats(vertices), vertices.size(), indices, triangles.size(), one_sided, out);
        });
    }
    /* Makes terrain. Fails with DCD_ERR_ARGUMENT also when `heights` does not have rows * columns numbers. */
    Result<ShapeId> shape_heightfield(Span<const float> heights, std::size_t rows, std::size_t columns, const Vec3 &scale)
    {
        const bool fits = rows == 0 || (heights.size() % rows == 0 && heights.size() / rows == columns);
        return got<ShapeId>([&](ShapeId *out) {
            return dcd_shape_heightfield(world_, heights.data(), fits ? rows : 0, columns, scale.data(), out);
        });
    }
    /* Makes the ground behind a plane through its origin. */
    Result<ShapeId> shape_half_space(const Vec3 &normal)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_half_space(world_, normal.data(), out); });
    }
    Result<ShapeId> shape_segment(const Vec3 &a, const Vec3 &b)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_segment(world_, a.data(), b.data(), out); });
    }
    /* Makes a rounded box, cylinder, cone or hull: grown by `border`, with edges and corners of that radius. */
    Result<ShapeId> shape_round(ShapeId shape, float border)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_round(world_, shape, border, out); });
    }
    /* Makes a compound. Fails with DCD_ERR_ARGUMENT also when there are not as many frames as parts. */
    Result<ShapeId> shape_compound(Span<const ShapeId> parts, Span<const Frame> frames)
    {
        const std::size_t count = parts.size() == frames.size() ? parts.size() : 0;
        return got<ShapeId>([&](ShapeId *out) {
            return dcd_shape_compound(world_, parts.data(), frames.data(), count, out);
        });
    }
    Result<ShapeId> shape_scale(ShapeId shape, const float (&scale)[3])
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_scale(world_, shape, scale, out); });
    }
    /* Returns the kind and measures of any shape, also one that collider_shape found. */
    Result<ShapeInfo> shape_info(ShapeId shape) const
    {
        return got<ShapeInfo>([&](ShapeInfo *out) { return dcd_shape_info(world_, shape, out); });
    }
    Result<std::vector<Vec3>> shape_vertices(ShapeId shape) const
    {
        return listed<Vec3>([&](Vec3 *out, std::size_t cap, std::size_t *count) {
            return dcd_shape_vertices(world_, shape, out == nullptr ? nullptr : out->data(), cap, count);
        });
    }
    Result<std::vector<std::array<std::uint32_t, 3>>> shape_triangles(ShapeId shape) const
    {
        using Triangle = std::array<std::uint32_t, 3>;
        return listed<Triangle>([&](Triangle *out, std::size_t cap, std::size_t *count) {
            return dcd_shape_triangles(world_, shape, out == nullptr ? nullptr : out->data(), cap, count);
        });
    }
    Result<std::vector<float>> shape_heights(ShapeId shape) const
    {
        return listed<float>([&](float *out, std::size_t cap, std::size_t *count) {
            return dcd_shape_heights(world_, shape, out, cap, count);
        });
    }
    /* Returns one of the shapes that a compound is made of. `frame` receives where it is in the compound. */
    Result<ShapeId> shape_part(ShapeId shape, std::uint32_t part, Frame *frame = nullptr)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_shape_part(world_, shape, part, out, frame); });
    }
    Status shape_destroy(ShapeId shape) { return Status(dcd_shape_destroy(world_, shape)); }

    /* Bodies. */

    Result<BodyId> body_create(const BodyDef &def)
    {
        return got<BodyId>([&](BodyId *out) { return dcd_body_create(world_, &def, out); });
    }
    Result<std::vector<BodyId>> bodies_create(Span<const BodyDef> defs)
    {
        std::vector<BodyId> ids(defs.size());
        Status status(dcd_bodies_create(world_, defs.data(), defs.size(), ids.data()));
        return { status, std::move(ids) };
    }
    Result<BodyId> character_create(const BodyDef &body, const CharacterDef &character)
    {
        return got<BodyId>([&](BodyId *out) { return dcd_character_create(world_, &body, &character, out); });
    }
    Result<BodyId> vehicle_create(const BodyDef &body, const VehicleDef &vehicle)
    {
        return got<BodyId>([&](BodyId *out) { return dcd_vehicle_create(world_, &body, &vehicle, out); });
    }
    Status vehicle_drive(BodyId vehicle, const Drive &drive) { return Status(dcd_vehicle_drive(world_, vehicle, &drive)); }
    /* Returns on what a character stands. */
    Result<CharacterState> character_state(BodyId character) const
    {
        return got<CharacterState>([&](CharacterState *out) { return dcd_character_state(world_, character, out); });
    }
    /* Returns where the wheels of a vehicle are, and on what they stand. */
    Result<std::vector<WheelState>> vehicle_wheels(BodyId vehicle) const
    {
        return listed<WheelState>([&](WheelState *out, std::size_t cap, std::size_t *count) {
            return dcd_vehicle_wheels(world_, vehicle, out, cap, count);
        });
    }
    Status body_destroy(BodyId body) { return Status(dcd_body_destroy(world_, body)); }
    Status bodies_destroy(Span<const BodyId> bodies)
    {
        return Status(dcd_bodies_destroy(world_, bodies.data(), bodies.size()));
    }
    bool body_is_valid(BodyId body) const noexcept { return dcd_body_is_valid(world_, body); }
    /* Returns all bodies, fixed ones too. */
    Result<std::vector<BodyId>> bodies() const
    {
        return listed<BodyId>([&](BodyId *out, std::size_t cap, std::size_t *count) {
            return dcd_bodies(world_, out, cap, count);
        });
    }
    /* Returns the points at which a body touches others now. */
    Result<std::vector<ContactPoint>> body_contacts(BodyId body) const
    {
        return listed<ContactPoint>([&](ContactPoint *out, std::size_t cap, std::size_t *count) {
            return dcd_body_contacts(world_, body, out, cap, count);
        });
    }
    /* Pushes the bodies near an explosion, once. Returns how many. */
    Result<std::size_t> explode(const Explosion &explosion)
    {
        return got<std::size_t>([&](std::size_t *out) { return dcd_explode(world_, &explosion, out); });
    }
    /* Pushes the bodies in a fluid as it does in one step: call it before each step. Returns how many. */
    Result<std::size_t> flow(const Fluid &fluid)
    {
        return got<std::size_t>([&](std::size_t *out) { return dcd_flow(world_, &fluid, out); });
    }
    /* Returns the movable bodies inside a sensor now. */
    Result<std::vector<BodyId>> sensor_bodies(BodyId body, std::uint32_t collider = 0) const
    {
        return listed<BodyId>([&](BodyId *out, std::size_t cap, std::size_t *count) {
            return dcd_sensor_bodies(world_, body, collider, out, cap, count);
        });
    }
    Result<BodyExtent> body_extent(BodyId body) const
    {
        return got<BodyExtent>([&](BodyExtent *out) { return dcd_body_extent(world_, body, out); });
    }
    Result<ShapeId> collider_shape(BodyId body, std::uint32_t collider = 0)
    {
        return got<ShapeId>([&](ShapeId *out) { return dcd_collider_shape(world_, body, collider, out); });
    }
    Result<BodyId> body_at(std::uint32_t index) const
    {
        return got<BodyId>([&](BodyId *out) { return dcd_body_at(world_, index, out); });
    }
    Result<BodyInfo> body_info(BodyId body) const
    {
        return got<BodyInfo>([&](BodyInfo *out) { return dcd_body_info(world_, body, out); });
    }
    Result<Owner> body_owner(BodyId body) const
    {
        return got<Owner>([&](Owner *out) { return dcd_body_owner(world_, body, out); });
    }
    Result<Motion> body_get(BodyId body) const
    {
        return got<Motion>([&](Motion *out) { return dcd_body_get(world_, body, &out->pose, &out->velocity); });
    }
    Status body_set_pose(BodyId body, const Pose &pose) { return Status(dcd_body_set_pose(world_, body, &pose)); }
    Status body_set_velocity(BodyId body, const Velocity &velocity)
    {
        return Status(dcd_body_set_velocity(world_, body, &velocity));
    }
    /* Sets the kinematic target of a body of type DCD_KINEMATIC_POSE. */
    Status body_set_target(BodyId body, const Pose &pose) { return Status(dcd_body_set_target(world_, body, &pose)); }
    Result<BodyProperties> body_properties(BodyId body) const
    {
        return got<BodyProperties>([&](BodyProperties *out) { return dcd_body_properties(world_, body, out); });
    }
    Status body_set_properties(BodyId body, const BodyProperties &properties)
    {
        return Status(dcd_body_set_properties(world_, body, &properties));
    }
    Status body_wake(BodyId body) { return Status(dcd_body_wake(world_, body)); }
    Status body_sleep(BodyId body) { return Status(dcd_body_sleep(world_, body)); }
    /* Applies an impulse at the centre of mass. */
    Status body_apply_impulse(BodyId body, const Vec3 &impulse)
    {
        return Status(dcd_body_apply_impulse(world_, body, impulse.data(), nullptr));
    }
    Status body_apply_impulse(BodyId body, const Vec3 &impulse, const Point &point)
    {
        return Status(dcd_body_apply_impulse(world_, body, impulse.data(), point.data()));
    }
    Status body_apply_torque_impulse(BodyId body, const Vec3 &impulse)
    {
        return Status(dcd_body_apply_torque_impulse(world_, body, impulse.data()));
    }
    Status body_set_force(BodyId body, const Vec3 &force, const Vec3 &torque = {})
    {
        return Status(dcd_body_set_force(world_, body, force.data(), torque.data()));
    }
    /* Adds a force at the centre of mass. */
    Status body_add_force(BodyId body, const Vec3 &force)
    {
        return Status(dcd_body_add_force(world_, body, force.data(), nullptr));
    }
    Status body_add_force(BodyId body, const Vec3 &force, const Point &point)
    {
        return Status(dcd_body_add_force(world_, body, force.data(), point.data()));
    }
    Status body_set_events(BodyId body, std::uint32_t events, float force_threshold, std::uint32_t collider = DCD_ALL_COLLIDERS)
    {
        return Status(dcd_body_set_events(world_, body, collider, events, force_threshold));
    }
    Status body_set_material(BodyId body, float friction, float restitution, std::uint32_t collider = DCD_ALL_COLLIDERS)
    {
        return Status(dcd_body_set_material(world_, body, collider, friction, restitution));
    }
    Status body_set_groups(BodyId body, std::uint32_t groups, std::uint32_t mask, std::uint32_t collider = DCD_ALL_COLLIDERS)
    {
        return Status(dcd_body_set_groups(world_, body, collider, groups, mask));
    }

    Result<ColliderProperties> collider_properties(BodyId body, std::uint32_t collider) const
    {
        return got<ColliderProperties>([&](ColliderProperties *out) { return dcd_collider_properties(world_, body, collider, out); });
    }
    Status collider_set_properties(BodyId body, std::uint32_t collider, const ColliderProperties &properties)
    {
        return Status(dcd_collider_set_properties(world_, body, collider, &properties));
    }
    Status collider_set_shape(BodyId body, std::uint32_t collider, ShapeId shape)
    {
        return Status(dcd_collider_set_shape(world_, body, collider, shape));
    }
    Result<std::uint32_t> collider_add(BodyId body, ShapeId shape, const ColliderProperties &properties = {})
    {
        return got<std::uint32_t>(
            [&](std::uint32_t *out) { return dcd_collider_add(world_, body, shape, &properties, out); });
    }
    Status collider_remove(BodyId body, std::uint32_t collider) { return Status(dcd_collider_remove(world_, body, collider)); }

    /* Joints. */

    Result<JointId> joint_create(const JointDef &def)
    {
        return got<JointId>([&](JointId *out) { return dcd_joint_create(world_, &def, out); });
    }
    bool joint_is_valid(JointId joint) const noexcept { return dcd_joint_is_valid(world_, joint); }
    Result<JointInfo> joint_info(JointId joint) const
    {
        return got<JointInfo>([&](JointInfo *out) { return dcd_joint_info(world_, joint, out); });
    }
    Result<std::vector<JointId>> body_joints(BodyId body) const
    {
        return listed<JointId>([&](JointId *out, std::size_t cap, std::size_t *count) {
            return dcd_body_joints(world_, body, out, cap, count);
        });
    }
    Status joint_set_motor(JointId joint, DcdJointAxis axis, const JointMotor &motor)
    {
        return Status(dcd_joint_set_motor(world_, joint, axis, &motor));
    }
    /* Stops the motor. */
    Status joint_set_motor(JointId joint, DcdJointAxis axis, std::nullptr_t)
    {
        return Status(dcd_joint_set_motor(world_, joint, axis, nullptr));
    }
    Result<JointMotor> joint_get_motor(JointId joint, DcdJointAxis axis) const
    {
        return got<JointMotor>([&](JointMotor *out) { return dcd_joint_get_motor(world_, joint, axis, out); });
    }
    Status joint_set_limit(JointId joint, DcdJointAxis axis, float low, float high)
    {
        const float limit[2] = { low, high };
        return Status(dcd_joint_set_limit(world_, joint, axis, limit));
    }
    /* Takes the limit away. */
    Status joint_set_limit(JointId joint, DcdJointAxis axis, std::nullptr_t)
    {
        return Status(dcd_joint_set_limit(world_, joint, axis, nullptr));
    }
    /* Returns the lowest and the highest position. */
    Result<std::array<float, 2>> joint_get_limit(JointId joint, DcdJointAxis axis) const
    {
        return got<std::array<float, 2>>(
            [&](std::array<float, 2> *out) { return dcd_joint_get_limit(world_, joint, axis, out->data()); });
    }
    Status joint_set_flags(JointId joint, std::uint32_t flags) { return Status(dcd_joint_set_flags(world_, joint, flags)); }
    Status joint_set_frames(JointId joint, const Frame &frame_a, const Frame &frame_b)
    {
        return Status(dcd_joint_set_frames(world_, joint, &frame_a, &frame_b));
    }
    /* Leaves frame a as it is. */
    Status joint_set_frames(JointId joint, std::nullptr_t, const Frame &frame_b)
    {
        return Status(dcd_joint_set_frames(world_, joint, nullptr, &frame_b));
    }
    /* Leaves frame b as it is. */
    Status joint_set_frames(JointId joint, const Frame &frame_a, std::nullptr_t)
    {
        return Status(dcd_joint_set_frames(world_, joint, &frame_a, nullptr));
    }
    Status joint_set_softness(JointId joint, float natural_frequency, float damping_ratio)
    {
        return Status(dcd_joint_set_softness(world_, joint, natural_frequency, damping_ratio));
    }
    /* Sets how much the locked axes of a joint bear: newtons and newton metres. */
    Status joint_set_strength(JointId joint, float force, float torque)
    {
        return Status(dcd_joint_set_strength(world_, joint, force, torque));
    }
    Status joint_destroy(JointId joint) { return Status(dcd_joint_destroy(world_, joint)); }

    /* Many at a time. Value says which field is meant: Pose, Velocity, Force, or std::uint64_t for the user data. The items may lie within
     * structs of the program's own: give the first one and the distance to the next in bytes. `each` has an entry for each body, as in
     * dcd.h. Without it the first bad body fails the call. */

    template <class Value>
    Status state_read(Span<const BodyId> bodies, Value *first, std::size_t stride = 0, DcdStatus *each = nullptr) const
    {
        return Status(dcd_state_read(world_, bodies.data(), bodies.size(), field<Value>(), first, stride, each));
    }
    template <class Value>
    Status state_write(Span<const BodyId> bodies, const Value *first, std::size_t stride = 0, DcdStatus *each = nullptr)
    {
        return Status(dcd_state_write(world_, bodies.data(), bodies.size(), field<Value>(), first, stride, each));
    }
    /* Sets the kinematic targets (DCD_FIELD_TARGET) of bodies of type DCD_KINEMATIC_POSE: their poses after the next step. */
    Status state_write_targets(Span<const BodyId> bodies, const Pose *first, std::size_t stride = 0, DcdStatus *each = nullptr)
    {
        return Status(dcd_state_write(world_, bodies.data(), bodies.size(), DCD_FIELD_TARGET, first, stride, each));
    }

    /* Queries. Answer i is to query i. */

    Result<std::vector<RayHit>> cast_rays(Span<const Ray> rays, const Filter &filter = {}) const
    {
        std::vector<RayHit> hits(rays.size());
        Status status(dcd_cast_rays(world_, rays.data(), rays.size(), &filter, hits.data()));
        return { status, std::move(hits) };
    }
    /* Submits rays, which are answered later, in a served world too: there they may hit bodies that this process does not know. */
    Result<QueryId> cast_rays_submit(Span<const Ray> rays, const Filter &filter = {})
    {
        return got<QueryId>([&](QueryId *out) { return dcd_cast_rays_submit(world_, rays.data(), rays.size(), &filter, out); });
    }
    /* Returns the answer to submitted rays; nothing while it is not there. */
    Result<std::optional<std::vector<RayHit>>> query_poll(QueryId query)
    {
        return polled<RayHit>(query, dcd_query_poll);
    }
    Status query_cancel(QueryId query) { return Status(dcd_query_cancel(world_, query)); }
    Result<QueryId> cast_shapes_submit(Span<const ShapeCast> casts, const Filter &filter = {})
    {
        return got<QueryId>(
            [&](QueryId *out) { return dcd_cast_shapes_submit(world_, casts.data(), casts.size(), &filter, out); });
    }
    Result<QueryId> overlap_shapes_submit(Span<const ShapeQuery> shapes, const Filter &filter = {})
    {
        return got<QueryId>(
            [&](QueryId *out) { return dcd_overlap_shapes_submit(world_, shapes.data(), shapes.size(), &filter, out); });
    }
    Result<QueryId> overlap_points_submit(Span<const PointQuery> points, const Filter &filter = {})
    {
        return got<QueryId>(
            [&](QueryId *out) { return dcd_overlap_points_submit(world_, points.data(), points.size(), &filter, out); });
    }
    Result<QueryId> overlap_boxes_submit(Span<const BoxQuery> boxes, const Filter &filter = {})
    {
        return got<QueryId>(
            [&](QueryId *out) { return dcd_overlap_boxes_submit(world_, boxes.data(), boxes.size(), &filter, out); });
    }
    Result<std::optional<std::vector<ShapeHit>>> query_poll_casts(QueryId query)
    {
        return polled<ShapeHit>(query, dcd_query_poll_casts);
    }
    /* Returns the answer to submitted overlaps; nothing while it is not there. `asked` is how many were submitted. */
    Result<std::optional<Found<Overlap>>> query_poll_overlaps(QueryId query, std::size_t asked)
    {
        Found<Overlap> all;
        all.ends.resize(asked);
        auto items = polled<Overlap>(query, [&](DcdWorld world, QueryId id, Overlap *out, std::size_t cap, std::size_t *count) {
            return dcd_query_poll_overlaps(world, id, out, cap, all.ends.data(), count);
        });
        if (!items || !*items) {
            return { items.status(), std::nullopt };
        }
        all.items = std::move(**items);
        return { items.status(), std::move(all) };
    }
    Result<Found<RayHit>> cast_rays_all(Span<const Ray> rays, const Filter &filter = {}) const
    {
        return found<RayHit>(rays, filter, dcd_cast_rays_all);
    }
    /* Calls `meet` with every body that a ray meets. It takes a const RayHit & and returns how far the ray goes from then on, metres; see
     * DcdRayFn. */
    template <class Meet> Status cast_ray_each(const Ray &ray, Meet meet, const Filter &filter = {}) const
    {
        const auto call = [](void *context, const DcdRayHit *hit) -> float { return (*static_cast<Meet *>(context))(*hit); };
        return Status(dcd_cast_ray_each(world_, &ray, &filter, call, std::addressof(meet)));
    }
    /* Calls `meet` with every body that a moving shape meets. It takes a const ShapeHit & and returns how much of its way the shape
     * goes from then on; see DcdShapeCastFn. */
    template <class Meet> Status cast_shape_each(const ShapeCast &cast, Meet meet, const Filter &filter = {}) const
    {
        const auto call = [](void *context, const DcdShapeHit *hit) -> float { return (*static_cast<Meet *>(context))(*hit); };
        return Status(dcd_cast_shape_each(world_, &cast, &filter, call, std::addressof(meet)));
    }
    /* Calls `meet` with every body that a shape overlaps. It takes a const Overlap & and returns whether to go on; see DcdOverlapFn. */
    template <class Meet> Status overlap_shape_each(const ShapeQuery &shape, Meet meet, const Filter &filter = {}) const
    {
        return Status(dcd_overlap_shape_each(world_, &shape, &filter, meeting<Meet>, std::addressof(meet)));
    }
    template <class Meet> Status overlap_box_each(const BoxQuery &box, Meet meet, const Filter &filter = {}) const
    {
        return Status(dcd_overlap_box_each(world_, &box, &filter, meeting<Meet>, std::addressof(meet)));
    }
    Result<std::vector<ShapeHit>> cast_shapes(Span<const ShapeCast> casts, const Filter &filter = {}) const
    {
        std::vector<ShapeHit> hits(casts.size());
        Status status(dcd_cast_shapes(world_, casts.data(), casts.size(), &filter, hits.data()));
        return { status, std::move(hits) };
    }
    Result<std::vector<PointHit>> project_points(Span<const PointQuery> points, const Filter &filter = {}) const
    {
        std::vector<PointHit> hits(points.size());
        Status status(dcd_project_points(world_, points.data(), points.size(), &filter, hits.data()));
        return { status, std::move(hits) };
    }
    Result<Found<Overlap>> overlap_points(Span<const PointQuery> points, const Filter &filter = {}) const
    {
        return found<Overlap>(points, filter, dcd_overlap_points);
    }
    Result<Found<Overlap>> overlap_shapes(Span<const ShapeQuery> shapes, const Filter &filter = {}) const
    {
        return found<Overlap>(shapes, filter, dcd_overlap_shapes);
    }
    Result<Found<Overlap>> overlap_boxes(Span<const BoxQuery> boxes, const Filter &filter = {}) const
    {
        return found<Overlap>(boxes, filter, dcd_overlap_boxes);
    }

private:
    DcdWorld world_{ 0 };

    template <class Meet> static bool meeting(void *context, const DcdOverlap *found)
    {
        return (*static_cast<Meet *>(context))(*found);
    }

    template <class Call> static Result<World> made(Call call)
    {
        DcdWorld world{ 0 };
        Status status(call(&world));
        return { status, World(world) };
    }
    template <class T, class Call> static Result<T> got(Call call)
    {
        T value{};
        Status status(call(&value));
        return { status, value };
    }
    /* Returns the answer to a query, or nothing while it is not there. */
    template <class T, class Call> Result<std::optional<std::vector<T>>> polled(QueryId query, Call call)
    {
        std::vector<T> items;
        std::size_t count = 0;
        DcdStatus code = call(world_, query, nullptr, 0, &count);
        if (code == DCD_OK && count > 0) {
            items.resize(count);
            code = call(world_, query, items.data(), items.size(), &count);
        }
        if (code == DCD_ERR_BUSY) {
            return { Status(DCD_OK), std::nullopt };
        }
        return { Status(code), std::move(items) };
    }
    /* Asks for the number of items, then for the items, and again when there are more by then. */
    template <class T, class Call> static Result<std::vector<T>> listed(Call call)
    {
        std::vector<T> items;
        std::size_t count = 0;
        DcdStatus code = call(nullptr, 0, &count);
        while (code == DCD_ERR_SMALL_BUFFER || (code == DCD_OK && count > items.size())) {
            items.resize(count);
            code = call(items.data(), items.size(), &count);
        }
        Status status(code);
        items.resize(status ? count : 0);
        return { status, std::move(items) };
    }
    /* Does the same for a batch of queries. */
    template <class T, class Question, class Call>
    Result<Found<T>> found(Span<const Question> questions, const Filter &filter, Call call) const
    {
        Found<T> all;
        all.ends.resize(questions.size());
        std::size_t total = 0;
        const auto ask = [&](T *out) {
            return call(world_, questions.data(), questions.size(), &filter, out, all.items.size(), all.ends.data(), &total);
        };
        DcdStatus code = ask(nullptr);
        while (code == DCD_ERR_SMALL_BUFFER || (code == DCD_OK && total > all.items.size())) {
            all.items.resize(total);
            code = ask(all.items.data());
        }
        Status status(code);
        all.items.resize(status ? total : 0);
        return { status, std::move(all) };
    }
    /* Asks with room that most texts need, and again with room for this one if that is too small. */
    template <class Call> static Result<std::string> text(Call call)
    {
        std::string text(511, '\0');
        std::size_t needed = 0;
        DcdStatus code = call(&text[0], text.size() + 1, &needed);
        if (code == DCD_ERR_SMALL_BUFFER) {
            text.resize(needed);
            code = call(&text[0], text.size(), &needed);
        }
        Status status(code);
        text.resize(status ? needed - 1 : 0);
        return { status, std::move(text) };
    }
    static const float *floats(Span<const Vec3> points) { return points.empty() ? nullptr : points.data()->data(); }
    template <class Value> static constexpr DcdField field()
    {
        static_assert(std::is_same_v<Value, Pose> || std::is_same_v<Value, Velocity> || std::is_same_v<Value, Force> ||
                          std::is_same_v<Value, std::uint64_t>,
                      "bodies have a Pose, a Velocity, a Force and a std::uint64_t of user data");
        return std::is_same_v<Value, Pose>       ? DCD_FIELD_POSE
               : std::is_same_v<Value, Velocity> ? DCD_FIELD_VELOCITY
               : std::is_same_v<Value, Force>    ? DCD_FIELD_FORCE
                                                 : DCD_FIELD_USER_DATA;
    }
};
static_assert(sizeof(Vec3) == 3 * sizeof(float), "points lie in a row");

/* One body, shape or joint that is destroyed with this object. It keeps the handle of its world, not the World object, which may be moved.
 * When the world is gone before it, there is nothing left to do. */
template <class Id> class Owned {
public:
    Owned() noexcept = default;
    Owned(const World &world, Id id) noexcept : world_(world.handle()), id_(id) {}
    Owned(Owned &&other) noexcept : world_(other.world_), id_(other.release()) {}
    Owned &operator=(Owned &&other) noexcept
    {
        const DcdWorld world = other.world_;
        const Id taken = other.release();
        reset();
        world_ = world;
        id_ = taken;
        return *this;
    }
    Owned(const Owned &) = delete;
    Owned &operator=(const Owned &) = delete;
    ~Owned() { reset(); }

    Id id() const noexcept { return id_; }
    operator Id() const noexcept { return id_; }
    /* Gives the id away. What it names lives on. */
    Id release() noexcept { return std::exchange(id_, Id{ 0 }); }
    /* Destroys what the id names now. In a function that the library calls it is not destroyed yet, as with World::reset. */
    void reset() noexcept
    {
        if (id_.v != 0 && destroy(world_, id_) != DCD_ERR_BUSY) {
            id_ = Id{ 0 };
        }
    }

private:
    DcdWorld world_{ 0 };
    Id id_{ 0 };

    static DcdStatus destroy(DcdWorld world, BodyId id) noexcept { return dcd_body_destroy(world, id); }
    static DcdStatus destroy(DcdWorld world, ShapeId id) noexcept { return dcd_shape_destroy(world, id); }
    static DcdStatus destroy(DcdWorld world, JointId id) noexcept { return dcd_joint_destroy(world, id); }
};

inline Status version_check()
{
    return Status(dcd_version_check());
}
inline const char *refused_string(std::uint32_t reason) noexcept
{
    return dcd_refused_string(reason);
}
inline Status log_set(DcdLogFn function, void *user, DcdLogLevel most)
{
    return Status(dcd_log_set(function, user, most));
}
inline Status allocator_set(DcdAllocateFn allocate, DcdFreeFn free, void *context)
{
    return Status(dcd_allocator_set(allocate, free, context));
}
inline Status bug_set(DcdBugFn function, void *context)
{
    return Status(dcd_bug_set(function, context));
}
inline Result<Pose> pose_interpolate(const Pose &from, const Pose &to, double t)
{
    Pose between{};
    Status status(dcd_pose_interpolate(&from, &to, t, &between));
    return { status, between };
}
inline std::uint32_t version() noexcept
{
    return dcd_version();
}
inline const char *version_string() noexcept
{
    return dcd_version_string();
}

} // inline namespace

} // namespace dcd

#undef DCD_NODISCARD_

#endif /* DCD_HPP */
