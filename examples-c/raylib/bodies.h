/* What is drawn: the bodies that this process knows of, each with meshes for its shapes. */
#ifndef BODIES_H
#define BODIES_H

#include "dcd.h"
#include "raylib.h"

enum { BODIES_BUCKETS = 4096 };

/* Which bodies are drawn: those that never move, or those that do. */
typedef enum Mobility { SCENERY, MOVABLE } Mobility;

typedef struct Bodies {
    DcdWorld world;
    struct Body *buckets[BODIES_BUCKETS]; /* by id */
    struct Lump *lumps;                   /* meshes of hulls, terrain and the like */
    Mesh box, ball, cylinder, cone, plane;
    size_t count, meshes;
    unsigned long frame;
} Bodies;

/* Takes in the bodies that a world has by now. */
void bodies_open(Bodies *bodies, DcdWorld world);

/* Take in a body that appeared, and drop one that was removed. Doing so twice does no harm. */
void bodies_add(Bodies *bodies, DcdBodyId id);
void bodies_remove(Bodies *bodies, DcdBodyId id);

/* Puts movable bodies where they are shown in this frame. */
void bodies_show(Bodies *bodies, const DcdStateView *view, DcdBodyId avatar);

/* Draws bodies, relative to `origin`: world space has doubles, and a renderer has floats. */
void bodies_draw(const Bodies *bodies, Mobility mobility, Material material, const double origin[3]);

/* Ends the program when a call of dcd fails. */
void check(DcdStatus status);

#endif
