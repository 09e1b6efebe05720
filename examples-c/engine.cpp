/* A small engine: a loop of fixed steps, frames between them, and a renderer that looks down from above into PNG files.
 *
 *   engine [FOLDER [SECONDS]]
 *
 * FOLDER is `frames` unless told otherwise, and is made.
 *
 * A wheel sweeps balls and boxes about on a plain of four regions. A colour stands for the region that owns a body; lighter is
 * higher. The frames are simulated, 30 per second, so that the program always draws the same. */
#include "dcd.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

namespace {

struct Colour {
    std::uint8_t r, g, b;
};

/* Pixels, and how they become a file: a PNG. Its deflate blocks are not compressed, so that no library is needed. */
class Image {
public:
    Image(int width, int height, Colour ground)
        : width_(width), height_(height), pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), ground)
    {
    }
    int width() const { return width_; }
    int height() const { return height_; }
    void set(int x, int y, Colour colour)
    {
        if (x >= 0 && x < width_ && y >= 0 && y < height_) {
            pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)] = colour;
        }
    }

    bool save(const std::string &path) const
    {
        std::vector<std::uint8_t> rows;
        for (int y = 0; y < height_; y++) {
            rows.push_back(0); /* the row is not filtered */
            for (int x = 0; x < width_; x++) {
                const Colour c =
                    pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
                rows.insert(rows.end(), { c.r, c.g, c.b });
            }
        }
        std::vector<std::uint8_t> stream = { 0x78, 0x01 };
        const std::size_t most = 65535;
        std::uint32_t a = 1, b = 0; /* Adler-32 */
        for (std::size_t from = 0; from < rows.size(); from += most) {
            const std::size_t length = std::min(most, rows.size() - from);
            const auto low = static_cast<std::uint8_t>(length), high = static_cast<std::uint8_t>(length >> 8);
            const bool last = from + length == rows.size();
            stream.insert(stream.end(), { static_cast<std::uint8_t>(last), low, high, static_cast<std::uint8_t>(~low),
                                          static_cast<std::uint8_t>(~high) });
            for (std::size_t i = from; i < from + length; i++) {
                stream.push_back(rows[i]);
                a = (a + rows[i]) % 65521;
                b = (b + a) % 65521;
            }
        }
        append(stream, b << 16 | a);

        std::vector<std::uint8_t> header;
        append(header, static_cast<std::uint32_t>(width_));
        append(header, static_cast<std::uint32_t>(height_));
        header.insert(header.end(), { 8, 2, 0, 0, 0 }); /* 8 bits, red green blue */
        std::vector<std::uint8_t> file = { 0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n' };
        chunk(file, "IHDR", header);
        chunk(file, "IDAT", stream);
        chunk(file, "IEND", {});

        std::FILE *out = std::fopen(path.c_str(), "wb");
        if (out == nullptr) {
            return false;
        }
        const bool written = std::fwrite(file.data(), 1, file.size(), out) == file.size();
        return std::fclose(out) == 0 && written;
    }

private:
    int width_, height_;
    std::vector<Colour> pixels_;

    static void append(std::vector<std::uint8_t> &to, std::uint32_t value)
    {
        for (int shift = 24; shift >= 0; shift -= 8) {
            to.push_back(static_cast<std::uint8_t>(value >> shift));
        }
    }
    static void chunk(std::vector<std::uint8_t> &file, const char *name, const std::vector<std::uint8_t> &data)
    {
        append(file, static_cast<std::uint32_t>(data.size()));
        const std::size_t from = file.size();
        file.insert(file.end(), name, name + 4);
        file.insert(file.end(), data.begin(), data.end());
        std::uint32_t crc = 0xFFFFFFFFu;
        for (std::size_t i = from; i < file.size(); i++) {
            crc ^= file[i];
            for (int bit = 0; bit < 8; bit++) {
                crc = crc >> 1 ^ (crc & 1u ? 0xEDB88320u : 0u);
            }
        }
        append(file, ~crc);
    }
};

/* What the game knows of a body. Its index is the body's user data. */
struct Thing {
    enum { BALL, BOX, WHEEL } kind;
    float half[3];
};

class Game {
public:
    Game()
    {
        dcd::WorldDef def;
        def.regions = 4;
        def.min[1] = -8.0; /* lower than wide, so that dcd cuts it along x and z */
        def.max[1] = 8.0;
        world_ = *dcd::World::create(def);
        dt_ = static_cast<double>(world_.info()->dt);

        dcd::BodyDef ground;
        ground.body_type = DCD_FIXED;
        ground.shape = *world_.shape_box({ 30.0f, 0.5f, 30.0f });
        ground.pose.p[1] = -0.5;
        world_.body_create(ground).status().expect();

        std::vector<dcd::BodyDef> defs;
        add(defs, { Thing::WHEEL, { 6.0f, 0.5f, 0.3f } }, 0.0, 0.6, 0.0);
        defs[0].body_type = DCD_KINEMATIC;
        defs[0].velocity.angular[1] = 1.5f;
        for (int i = 0; i < 300; i++) {
            const double turn = 2.399963 * i, far = 1.0 + 0.5 * std::sqrt(static_cast<double>(i)); /* as sunflowers seed */
            const float size = 0.2f + 0.02f * static_cast<float>(i % 10);
            const Thing thing = { i % 2 == 0 ? Thing::BALL : Thing::BOX, { size, size, size } };
            add(defs, thing, far * std::cos(turn), 1.5 + 0.5 * (i % 7), far * std::sin(turn));
        }
        world_.bodies_create(defs).status().expect();
        now_ = before_ = *world_.state_view();
    }

    double dt() const { return dt_; }

    void step()
    {
        world_.step().expect();
        before_ = now_; /* stays readable until the step after next */
        now_ = *world_.state_view();
        const dcd::EventView events = *world_.events();
        transfers_ += events.transfers().size();
    }

    std::size_t transfers() const { return transfers_; }

    /* Draws what lies between the last two steps, at `t` from 0 to 1. Here both have the same bodies in the same order; a game
     * that makes and destroys bodies keeps poses by slot, as game_loop.c does. */
    Image draw(double t) const
    {
        Image image(320, 320, { 24, 26, 30 });
        for (int i = 0; i < image.width(); i++) { /* where the regions meet */
            image.set(i, image.height() / 2, { 60, 64, 72 });
            image.set(image.width() / 2, i, { 60, 64, 72 });
        }
        for (std::size_t i = 0; i < now_.size(); i++) {
            const dcd::Pose pose = *dcd::pose_interpolate(before_.poses()[i], now_.poses()[i], t);
            draw(image, things_[now_.user_data()[i]], pose, now_.regions()[i]);
        }
        return image;
    }

private:
    dcd::World world_;
    double dt_ = 0.0;
    std::vector<Thing> things_;
    dcd::StateView before_{ DcdStateView DCD_STATE_VIEW_INIT }, now_{ DcdStateView DCD_STATE_VIEW_INIT };
    std::size_t transfers_ = 0;

    void add(std::vector<dcd::BodyDef> &defs, const Thing &thing, double x, double y, double z)
    {
        dcd::BodyDef def;
        def.shape = thing.kind == Thing::BALL ? *world_.shape_sphere(thing.half[0])
                                              : *world_.shape_box({ thing.half[0], thing.half[1], thing.half[2] });
        def.pose.p[0] = x;
        def.pose.p[1] = y;
        def.pose.p[2] = z;
        def.user_data = things_.size();
        things_.push_back(thing);
        defs.push_back(def);
    }

    static void draw(Image &image, const Thing &thing, const dcd::Pose &pose, std::uint32_t region)
    {
        static const Colour PALETTE[] = { { 230, 110, 90 }, { 110, 190, 110 }, { 100, 140, 230 }, { 220, 190, 90 } };
        const double scale = image.width() / 26.0; /* pixels per metre */
        const double light = std::clamp(0.55 + 0.15 * pose.p[1], 0.4, 1.1);
        const Colour base = thing.kind == Thing::WHEEL ? Colour{ 200, 200, 205 } : PALETTE[region % 4];
        const auto shade = [&](std::uint8_t part) { return static_cast<std::uint8_t>(std::min(255.0, part * light)); };
        const Colour colour = { shade(base.r), shade(base.g), shade(base.b) };

        /* Its x and z axes on the ground. */
        const double x = static_cast<double>(pose.q[0]), y = static_cast<double>(pose.q[1]), z = static_cast<double>(pose.q[2]),
                     w = static_cast<double>(pose.q[3]);
        const double along[2] = { 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * z - w * y) };
        const double across[2] = { 2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y) };
        const double hx = static_cast<double>(thing.half[0]), hz = static_cast<double>(thing.half[2]);
        const int reach = static_cast<int>(std::ceil(scale * std::hypot(hx, hz)));
        const double cx = image.width() / 2 + scale * pose.p[0], cz = image.height() / 2 + scale * pose.p[2];
        for (int dz = -reach; dz <= reach; dz++) {
            for (int dx = -reach; dx <= reach; dx++) {
                const double px = dx / scale, pz = dz / scale;
                const bool inside = thing.kind == Thing::BALL
                                        ? std::hypot(px, pz) <= hx
                                        : std::fabs(px * along[0] + pz * along[1]) <= hx &&
                                              std::fabs(px * across[0] + pz * across[1]) <= hz;
                if (inside) {
                    image.set(static_cast<int>(cx) + dx, static_cast<int>(cz) + dz, colour);
                }
            }
        }
    }
};

} // namespace

int main(int argc, char **argv)
{
    const std::string folder = argc > 1 ? argv[1] : "frames";
    const double seconds = argc > 2 ? std::strtod(argv[2], nullptr) : 2.0;
    if (argc > 3 || !(seconds > 0.0)) {
        std::fprintf(stderr, "usage: engine [FOLDER [SECONDS]]\n");
        return EXIT_FAILURE;
    }
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed) {
        std::fprintf(stderr, "engine: cannot make the folder %s: %s\n", folder.c_str(), failed.message().c_str());
        return EXIT_FAILURE;
    }
    dcd::version_check().expect();
    Game game;
    const double frame = 1.0 / 30.0;
    double owed = 0.0; /* time that has passed and is not simulated yet */
    int frames = 0, steps = 0;
    for (double time = 0.0; time < seconds; time += frame, frames++) {
        owed += frame;
        while (owed >= game.dt()) {
            owed -= game.dt();
            game.step();
            steps++;
        }
        char name[32];
        std::snprintf(name, sizeof name, "/frame%04d.png", frames);
        if (!game.draw(owed / game.dt()).save(folder + name)) {
            std::fprintf(stderr, "engine: cannot write %s%s\n", folder.c_str(), name);
            return EXIT_FAILURE;
        }
    }
    std::printf("%d frames, %d steps, %zu transfers\n", frames, steps, game.transfers());
    return EXIT_SUCCESS;
}
