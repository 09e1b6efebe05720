/* A world is computed by the program's own threads: by a job system with threads, by one that runs each job
 * only when it is waited for, and by the library's own. All give the same bits. Bugs are reported to a
 * function. */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <pthread.h>

enum { BODIES = 600, STEPS = 40, MOST = 8 };

/* A job, and whether a thread runs it. */
typedef struct Job {
    DcdTaskFn run;
    void *task;
    pthread_t thread;
    bool is_running;
} Job;

typedef struct Jobs {
    Job jobs[MOST];
    size_t started, begun, finished, most; /* `begun`: on threads of their own */
    size_t threads;                        /* threads of the system */
    DcdWorld world;
    DcdStatus within;
} Jobs;

static void *work(void *job_)
{
    Job *job = job_;
    job->run(job->task);
    return NULL;
}

static void *enqueue(void *context, DcdTaskFn run, void *task)
{
    Jobs *jobs = context;
    const size_t open = jobs->started - jobs->finished;
    Job *job = &jobs->jobs[open];
    job->run = run;
    job->task = task;
    job->is_running = open < jobs->threads;
    if (job->is_running) {
        HOLDS(pthread_create(&job->thread, NULL, work, job) == 0);
        jobs->begun++;
    }
    jobs->started++;
    if (jobs->most < open + 1)
        jobs->most = open + 1;
    jobs->within = dcd_step(jobs->world);
    return job;
}

static void finish(void *context, void *started)
{
    Jobs *jobs = context;
    Job *job = started;
    if (job->is_running)
        HOLDS(pthread_join(job->thread, NULL) == 0);
    else
        job->run(job->task);
    jobs->finished++;
}

/* Makes a heap of boxes in this many regions. */
static DcdWorld heap(uint32_t regions)
{
    DcdWorldDef def = DCD_WORLD_DEF_INIT;
    DcdBodyDef cube = DCD_BODY_DEF_INIT, floor = DCD_BODY_DEF_INIT;
    DcdWorld world = { 0 };
    DcdBodyId body;
    const float half[3] = { 0.5f, 0.5f, 0.5f }, slab[3] = { 50.0f, 0.5f, 50.0f };
    def.regions = regions;
    def.threads = 3;
    for (int i = 0; i < 3; i++) {
        def.min[i] = -10.0;
        def.max[i] = 10.0;
    }
    OK(dcd_world_create(&def, &world));
    OK(dcd_shape_box(world, slab, &floor.shape));
    floor.body_type = DCD_FIXED;
    floor.pose.p[1] = -0.5;
    OK(dcd_body_create(world, &floor, &body));
    OK(dcd_shape_box(world, half, &cube.shape));
    for (int i = 0; i < BODIES; i++) {
        cube.pose.p[0] = -7.0 + 1.4 * (i % 10) + 0.01 * i;
        cube.pose.p[1] = 1.0 + 1.2 * (i / 100);
        cube.pose.p[2] = -7.0 + 1.4 * (i / 10 % 10);
        OK(dcd_body_create(world, &cube, &body));
    }
    return world;
}

static uint64_t run(DcdWorld world)
{
    uint64_t hash = 0;
    for (int i = 0; i < STEPS; i++)
        OK(dcd_step(world));
    OK(dcd_state_hash(world, &hash));
    return hash;
}

static void bits_do_not_depend_on_whose_threads_compute(uint32_t regions)
{
    DcdWorld library = heap(regions);
    const uint64_t expected = run(library);
    OK(dcd_world_destroy(library));
    for (size_t threads = 0; threads <= 3; threads++) {
        Jobs jobs = { .threads = threads, .world = heap(regions) };
        DcdTasks tasks = DCD_TASKS_INIT;
        tasks.context = &jobs;
        tasks.enqueue = enqueue;
        tasks.finish = finish;
        OK(dcd_tasks_set(jobs.world, &tasks));
        HOLDS(run(jobs.world) == expected);
        /* The library tries some steps on the calling thread, to see which is faster. They start no jobs. */
        HOLDS(jobs.started >= 3 && jobs.started % 3 == 0 && jobs.finished == jobs.started && jobs.most == 3);
        HOLDS(jobs.begun == jobs.started / 3 * threads && jobs.within == DCD_ERR_BUSY);

        /* Many queries start jobs too, and few do not. */
        DcdRay rays[300];
        DcdRayHit hits[300];
        const size_t before = jobs.started;
        for (int i = 0; i < 300; i++) {
            rays[i] = (DcdRay)DCD_RAY_INIT;
            rays[i].origin[0] = -8.0 + 0.05 * i;
            rays[i].origin[1] = 30.0;
            rays[i].direction[1] = -1.0f;
        }
        OK(dcd_cast_rays(jobs.world, rays, 300, NULL, hits));
        HOLDS(jobs.started == before + 3 && jobs.finished == jobs.started && hits[150].body.v != 0);
        OK(dcd_cast_rays(jobs.world, rays, 10, NULL, hits));
        HOLDS(jobs.started == before + 3);

        /* The library's own threads again. */
        OK(dcd_tasks_set(jobs.world, NULL));
        OK(dcd_step(jobs.world));
        HOLDS(jobs.started == before + 3);
        OK(dcd_world_destroy(jobs.world));
    }
}

static void misuse(void)
{
    DcdWorld world = heap(1);
    DcdTasks tasks = DCD_TASKS_INIT;
    FAILS(dcd_tasks_set(world, &tasks), DCD_ERR_NULL, "enqueue");
    tasks.enqueue = enqueue;
    FAILS(dcd_tasks_set(world, &tasks), DCD_ERR_NULL, "finish");
    tasks.finish = finish;
    tasks.reserved = 1;
    FAILS(dcd_tasks_set(world, &tasks), DCD_ERR_ARGUMENT, "reserved");
    tasks.reserved = 0;
    tasks.struct_size = 8;
    FAILS(dcd_tasks_set(world, &tasks), DCD_ERR_STRUCT, "DcdTasks");
    FAILS(dcd_tasks_set((DcdWorld){ 0 }, NULL), DCD_ERR_NULL, "world");
    OK(dcd_world_destroy(world));
    FAILS(dcd_tasks_set(world, NULL), DCD_ERR_STALE_ID, "world");
}

static void note_bug(void *context, const char *message, const char *file, uint32_t line)
{
    (void)message, (void)file, (void)line;
    ++*(int *)context;
}

int main(void)
{
    int bugs = 0;
    OK(dcd_bug_set(note_bug, &bugs));
    bits_do_not_depend_on_whose_threads_compute(1);
    bits_do_not_depend_on_whose_threads_compute(4);
    misuse();
    HOLDS(bugs == 0);
    OK(dcd_bug_set(NULL, NULL));
    return checked();
}
