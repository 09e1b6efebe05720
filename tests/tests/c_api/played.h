/* Shared by programs that serve a world, play in it, and look at it as one of its clients. */
#ifndef PLAYED_H
#define PLAYED_H

#include "checks.h"

#include <time.h>

static DcdWorld server, client;

static inline void step(void)
{
    struct timespec pause = { 0, 5 * 1000 * 1000 };
    OK(dcd_step(server));
    OK(dcd_step(client));
    nanosleep(&pause, NULL);
}

/* Where the client sees the i-th body; far below everything if the client does not see it. */
static inline DcdPose seen(uint32_t i)
{
    DcdPose pose = { { 0.0, -1e6, 0.0 }, { 0.0f, 0.0f, 0.0f, 1.0f } };
    DcdBodyId body;
    if (dcd_body_at(client, i, &body) == DCD_OK)
        OK(dcd_body_get(client, body, &pose, NULL));
    return pose;
}

#endif /* PLAYED_H */
