#include "light.h"

#include "raymath.h"
#include "rlgl.h"

#include <math.h>

#define SKY "vec3(0.62, 0.74, 0.86)"

static const int TEXELS = 2048;   /* of the shadows, along each edge */
static const float SHADED = 64.0f; /* metres around the origin that have shadows */

static const char *VERTEX =
    "#version 330\n"
    "in vec3 vertexPosition; in vec3 vertexNormal;\n"
    "uniform mat4 mvp, matModel, matNormal;\n"
    "out vec3 at, normal;\n"
    "void main() {\n"
    "    at = (matModel * vec4(vertexPosition, 1.0)).xyz;\n"
    "    normal = (matNormal * vec4(vertexNormal, 0.0)).xyz;\n"
    "    gl_Position = mvp * vec4(vertexPosition, 1.0);\n"
    "}\n";

static const char *FRAGMENT =
    "#version 330\n"
    "in vec3 at, normal;\n"
    "uniform vec4 colDiffuse;\n"
    "uniform vec3 eye, origin;\n"
    "uniform float grid;\n"
    "uniform mat4 shadow_from_world;\n"
    "uniform sampler2D shadows;\n"
    "out vec4 colour;\n"
    "const vec3 SUN = normalize(vec3(0.5, 0.9, 0.4));\n"
    "float sunlit(vec3 n) {\n"
    "    vec3 p = (shadow_from_world * vec4(at + 0.04 * n, 1.0)).xyz * 0.5 + 0.5;\n"
    "    if (any(lessThan(p, vec3(0.0))) || any(greaterThan(p, vec3(1.0)))) return 1.0;\n"
    "    float sum = 0.0;\n"
    "    vec2 texel = 1.0 / vec2(textureSize(shadows, 0));\n"
    "    for (int x = -1; x <= 1; x++) for (int y = -1; y <= 1; y++)\n"
    "        sum += step(p.z - 0.0003, texture(shadows, p.xy + vec2(x, y) * texel).r);\n"
    "    return sum / 9.0;\n"
    "}\n"
    "float line(vec2 p) {\n"
    "    vec2 d = abs(fract(p - 0.5) - 0.5) / fwidth(p);\n"
    "    return (1.0 - min(min(d.x, d.y), 1.0)) / (1.0 + 8.0 * length(fwidth(p)));\n"
    "}\n"
    "void main() {\n"
    "    vec3 n = normalize(normal);\n"
    "    vec3 base = pow(colDiffuse.rgb, vec3(2.2));\n"
    "    vec2 plan = (at + origin).xz;\n"
    "    if (n.y > 0.5) base *= 1.0 - grid * (0.35 * line(plan) + 0.35 * line(plan / 10.0));\n"
    "    float sun = max(dot(n, SUN), 0.0);\n"
    "    if (sun > 0.0) sun *= sunlit(n);\n"
    "    vec3 light = sun * vec3(1.25, 1.15, 0.95) + mix(vec3(0.16, 0.14, 0.12), vec3(0.34, 0.42, 0.55), 0.5 + 0.5 * n.y);\n"
    "    vec3 shown = pow(base * light, vec3(1.0 / 2.2));\n"
    "    float far = 1.0 - exp(-pow(distance(at, eye) / 130.0, 2.0));\n"
    "    colour = vec4(mix(shown, " SKY ", far), 1.0);\n"
    "}\n";

/* Loads a texture of depths alone, which a shader can read. */
static RenderTexture2D load_depths(int texels)
{
    RenderTexture2D target = { .id = rlLoadFramebuffer(), .texture = { .width = texels, .height = texels } };
    target.depth = (Texture2D){ rlLoadTextureDepth(texels, texels, false), texels, texels, 1, PIXELFORMAT_UNCOMPRESSED_GRAYSCALE };
    rlEnableFramebuffer(target.id);
    rlFramebufferAttach(target.id, target.depth.id, RL_ATTACHMENT_DEPTH, RL_ATTACHMENT_TEXTURE2D, 0);
    rlDisableFramebuffer();
    return target;
}

Light light_load(void)
{
    Light light = { .material = LoadMaterialDefault(), .lit = LoadShaderFromMemory(VERTEX, FRAGMENT), .shadows = load_depths(TEXELS) };
    light.plain = light.material.shader;
    light.eye = GetShaderLocation(light.lit, "eye");
    light.origin = GetShaderLocation(light.lit, "origin");
    light.grid = GetShaderLocation(light.lit, "grid");
    light.shadow_from_world = GetShaderLocation(light.lit, "shadow_from_world");
    light.lit.locs[SHADER_LOC_MAP_EMISSION] = GetShaderLocation(light.lit, "shadows");
    return light;
}

void light_begin_shadows(Light *light)
{
    const Camera3D sun = { .position = Vector3Scale(Vector3Normalize((Vector3){ 0.5f, 0.9f, 0.4f }), 100.0f),
                           .up = { 0.0f, 1.0f, 0.0f },
                           .fovy = SHADED,
                           .projection = CAMERA_ORTHOGRAPHIC };
    rlSetClipPlanes(1.0, 200.0);
    BeginTextureMode(light->shadows);
    ClearBackground(WHITE);
    BeginMode3D(sun);
    const Matrix shadow_from_world = MatrixMultiply(rlGetMatrixModelview(), rlGetMatrixProjection());
    SetShaderValueMatrix(light->lit, light->shadow_from_world, shadow_from_world);
    light->material.shader = light->plain;
    light->material.maps[MATERIAL_MAP_EMISSION].texture.id = 0;
}

void light_begin(Light *light, Camera3D camera, const double origin[3])
{
    EndMode3D();
    EndTextureMode();
    rlSetClipPlanes(0.1, 500.0);
    ClearBackground((Color){ 158, 189, 219, 255 });
    BeginMode3D(camera);
    /* Lines lie on every metre of world space, wherever the origin is. The shader's floats only need the origin modulo 10 m. */
    const float within[3] = { (float)fmod(origin[0], 10.0), 0.0f, (float)fmod(origin[2], 10.0) };
    SetShaderValue(light->lit, light->origin, within, SHADER_UNIFORM_VEC3);
    SetShaderValue(light->lit, light->eye, &camera.position, SHADER_UNIFORM_VEC3);
    light->material.shader = light->lit;
    light->material.maps[MATERIAL_MAP_EMISSION].texture = light->shadows.depth;
}

void light_end(void)
{
    EndMode3D();
}

void light_grid(const Light *light, bool lines)
{
    const float grid = lines ? 1.0f : 0.0f;
    SetShaderValue(light->lit, light->grid, &grid, SHADER_UNIFORM_FLOAT);
}
