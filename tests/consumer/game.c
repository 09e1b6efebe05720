/* Shows that the library was found, linked and works: a ball falls for a second. */
#include <dcd.h>

#include <stdio.h>

int main(void)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef ball = DCD_BODY_DEF_INIT;
    DcdPose pose;
    DcdWorld world;
    DcdBodyId id;

    bool good = dcd_version_check() == DCD_OK && dcd_world_create(&def, &world) == DCD_OK &&
                dcd_shape_sphere(world, 0.5f, &ball.shape) == DCD_OK && dcd_body_create(world, &ball, &id) == DCD_OK;
    for (int i = 0; good && i < 60; i++) {
        good = dcd_step(world) == DCD_OK;
    }
    good = good && dcd_body_get(world, id, &pose, NULL) == DCD_OK && dcd_world_destroy(world) == DCD_OK;
    if (!good) {
        char message[512];
        dcd_last_error(message, sizeof message);
        fprintf(stderr, "%s\n", message);
        return 1;
    }
    printf("dcd %s, fell to %.1f m\n", dcd_version_string(), pose.p[1]);
    return 0;
}
