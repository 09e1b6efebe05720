/* A sun with shadows, a sky, and lines for each metre of the scenery. It knows nothing of dcd. */
#ifndef LIGHT_H
#define LIGHT_H

#include "raylib.h"

typedef struct Light {
    Material material; /* to draw with, in both passes */
    Shader lit, plain;
    RenderTexture2D shadows;
    int eye, origin, grid, shadow_from_world;
} Light;

Light light_load(void);

/* What is drawn between these two calls casts shadows. What is drawn after light_begin is lit, as seen by `camera`, until light_end. */
void light_begin_shadows(Light *light);
void light_begin(Light *light, Camera3D camera, const double origin[3]);
void light_end(void);

/* Sets whether what is drawn next shows lines for each metre. */
void light_grid(const Light *light, bool lines);

#endif
