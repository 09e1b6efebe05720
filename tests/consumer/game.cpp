/* The same as game.c in C++, with the C++ header. */
#include <dcd.hpp>

#include <cstdio>

int main()
{
    dcd::version_check().expect();
    dcd::World world = *dcd::World::create();
    dcd::BodyDef ball;
    ball.shape = *world.shape_sphere(0.5f);
    const dcd::BodyId id = *world.body_create(ball);
    for (int i = 0; i < 60; i++) {
        world.step().expect();
    }
    std::printf("dcd %s, fell to %.1f m\n", dcd::version_string(), world.body_get(id)->pose.p[1]);
}
