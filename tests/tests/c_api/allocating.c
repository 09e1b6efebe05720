/* All memory of the library comes from the program's functions. Run by `.ci/run`, with a library built for
 * it. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <stdatomic.h>

/* Blocks and bytes in use, calls so far, and blocks that came back as another. */
typedef struct Heap {
    atomic_size_t blocks, bytes, calls, wrong;
} Heap;

/* The head before each block: the size and alignment that were asked for. */
typedef struct Head {
    size_t size, alignment;
    void *start;
} Head;

static void *allocate(void *context, size_t size, size_t alignment)
{
    Heap *heap = context;
    char *start = malloc(size + alignment + sizeof(Head));
    if (start == NULL)
        return NULL;
    char *block = start + sizeof(Head);
    block += (alignment - (size_t)block % alignment) % alignment;
    const Head head = { size, alignment, start };
    memcpy(block - sizeof head, &head, sizeof head);
    atomic_fetch_add(&heap->blocks, 1);
    atomic_fetch_add(&heap->bytes, size);
    atomic_fetch_add(&heap->calls, 1);
    return block;
}

static void release(void *context, void *block, size_t size, size_t alignment)
{
    Heap *heap = context;
    Head head;
    memcpy(&head, (char *)block - sizeof head, sizeof head);
    if (head.size != size || head.alignment != alignment)
        atomic_fetch_add(&heap->wrong, 1);
    atomic_fetch_sub(&heap->blocks, 1);
    atomic_fetch_sub(&heap->bytes, size);
    free(head.start);
}

/* The bytes that each of 4,000 balls takes in a world of one region, as in tests/tests/steady_state.rs. */
static double bytes_per_body(const Heap *heap, double gap)
{
    enum { COUNT = 4000 };
    const size_t before = heap->bytes;
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdWorld world;
    DcdBodyId id;
    def.threads = 1;
    OK(dcd_world_create(&def, &world));
    OK(dcd_shape_sphere(world, 0.5f, &body.shape));
    for (int i = 0; i < COUNT; i++) {
        body.pose.p[0] = gap * (i % 60);
        body.pose.p[1] = 0.5;
        body.pose.p[2] = gap * (i / 60);
        body.user_data = (uint64_t)i;
        body.friction = i % 2 ? 0.6f : 0.5f;
        OK(dcd_body_create(world, &body, &id));
    }
    for (int i = 0; i < 30; i++)
        OK(dcd_step(world));
    const double bytes = (double)(heap->bytes - before) / COUNT;
    OK(dcd_world_destroy(world));
    return bytes;
}

int main(void)
{
    static Heap heap;
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef body = DCD_BODY_DEF_INIT;
    DcdWorld world;
    DcdBodyId id;
    OK(dcd_allocator_set(allocate, release, &heap));
    HOLDS(heap.calls == 0);
    def.regions = 4;
    def.threads = 2;
    for (int round = 0; round < 3; round++) {
        const size_t before = heap.bytes;
        OK(dcd_world_create(&def, &world));
        OK(dcd_shape_sphere(world, 0.5f, &body.shape));
        for (int i = 0; i < 500; i++) {
            body.pose.p[0] = i % 20 - 10.0;
            body.pose.p[1] = i / 20;
            OK(dcd_body_create(world, &body, &id));
        }
        for (int i = 0; i < 30; i++)
            OK(dcd_step(world));
        const size_t full = heap.bytes;
        OK(dcd_world_destroy(world));
        /* Threads that are still ending may hold some memory. */
        HOLDS(full - before > 500 * 500 && heap.bytes < before + 65536);
    }
    const double apart = bytes_per_body(&heap, 2.0), touching = bytes_per_body(&heap, 0.99);
    printf("a body takes %.0f bytes, one that touches others %.0f\n", apart, touching);
    HOLDS(heap.calls > 1000 && heap.wrong == 0);
    FAILS(dcd_allocator_set(allocate, release, &heap), DCD_ERR_BUSY, "before all other");
    FAILS(dcd_allocator_set(NULL, release, &heap), DCD_ERR_NULL, "allocate");
    FAILS(dcd_allocator_set(allocate, NULL, &heap), DCD_ERR_NULL, "free");
    return checked();
}
