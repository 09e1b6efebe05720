/* The variant of dcd.hpp whose calls throw when they fail. */
#define DCD_EXCEPTIONS
#include "dcd.hpp"

#include <cstdio>
#include <cstring>

int throwing_failures();

int throwing_failures()
{
    int failures = 0;
    dcd::World world = *dcd::World::create();
    world.step(); /* the result may be ignored */
    dcd::BodyDef def;
    def.shape = *world.shape_sphere(0.5f);
    const dcd::BodyId ball = *world.body_create(def);
    world.body_destroy(ball);
    try {
        world.body_wake(ball);
        std::puts("a stale id does not throw");
        failures++;
    } catch (const dcd::Error &error) {
        failures += error.code() == DCD_ERR_STALE_ID && std::strstr(error.what(), "dcd_body_wake: ") == error.what() ? 0 : 1;
    }
    try {
        def.density = -1.0f;
        world.body_create(def);
        std::puts("a wrong definition does not throw");
        failures++;
    } catch (const std::runtime_error &) {
    }
    return failures;
}
