/* Connections and messages: a server, two nodes, a client and a participant in one process, over loopback:
 * `network FOLDER`, run by served.rs. */
#include "checks.h"

#include <pthread.h>

static DcdWorld server, nodes[2], client, participant, local;
static char address[64], token[512];

/* The events of one world's steps. */
typedef struct Heard {
    unsigned came, lost, back, gone;
    unsigned messages, datagrams;
    /* The last message. */
    DcdMessage last;
    char bytes[64];
    /* The last connection that ended. */
    DcdConnectionEvent ended;
} Heard;

/* Waits until something has come, makes a step, and counts its events. */
static DcdStatus hear(DcdWorld world, Heard *heard)
{
    DcdEventView events = DCD_EVENT_VIEW_INIT;
    dcd_poll(world, 1000);
    DcdStatus status = dcd_step(world);
    OK(dcd_events(world, &events));
    for (size_t i = 0; i < events.connection_count; i++) {
        const DcdConnectionEvent *event = &events.connections[i];
        heard->came += event->state == DCD_CONNECTION_CAME;
        heard->lost += event->state == DCD_CONNECTION_LOST;
        heard->back += event->state == DCD_CONNECTION_BACK;
        if (event->state == DCD_CONNECTION_GONE) {
            heard->gone++;
            heard->ended = *event;
        }
        HOLDS(event->connection.v != 0 && event->role != DCD_ROLE_LOCAL);
        bool is_there = event->state == DCD_CONNECTION_CAME || event->state == DCD_CONNECTION_BACK;
        HOLDS(is_there == (event->cause == DCD_CAUSE_NONE) && is_there == (event->reason[0] == 0));
    }
    for (size_t i = 0; i < events.message_count; i++) {
        const DcdMessage *message = &events.messages[i];
        heard->messages += message->flags == 0;
        heard->datagrams += message->flags == DCD_SEND_UNRELIABLE;
        heard->last = *message;
        size_t size = message->size < sizeof heard->bytes ? message->size : sizeof heard->bytes;
        if (size > 0)
            memcpy(heard->bytes, message->data, size);
        HOLDS((uintptr_t)message->data % sizeof(uint64_t) == 0 && (message->data == NULL) == (message->size == 0));
    }
    return status;
}

/* Hears until a condition holds, or for much longer than it can take. */
#define HEAR(world, heard, until) \
    do { \
        for (int tries = 0; tries < 30000 && !(until) && hear((world), (heard)) == DCD_OK; tries++) { \
        } \
        HOLDS(until); \
    } while (0)

static void mint(DcdRole role)
{
    size_t needed = 0;
    OK(dcd_token_create(server, role, 60, token, sizeof token, &needed));
}

static void start(const char *folder)
{
    const char *params[] = { "n=40" };
    DcdWorldDef cut = DCD_WORLD_DEF_INIT;
    DcdServerDef def = DCD_SERVER_DEF_INIT;
    DcdNodeDef node = DCD_NODE_DEF_INIT;
    DcdClientDef play = DCD_CLIENT_DEF_INIT;
    DcdParticipantDef both = DCD_PARTICIPANT_DEF_INIT;
    size_t needed = 0;
    cut.regions = 2;
    def.scene = "pile";
    def.params = params;
    def.param_count = 1;
    def.world = &cut;
    def.data_path = folder;
    OK(dcd_server_create(&def, &server));
    OK(dcd_address(server, address, sizeof address, &needed));
    node.server = play.server = both.server = address;
    node.token = play.token = both.token = token;
    for (int i = 0; i < 2; i++) {
        mint(DCD_ROLE_NODE);
        OK(dcd_node_join(&node, &nodes[i]));
    }
    mint(DCD_ROLE_CLIENT);
    OK(dcd_client_connect(&play, &client));
    mint(DCD_ROLE_PARTICIPANT);
    OK(dcd_participant_join(&both, &participant));
    OK(dcd_world_create(&cut, &local));
}

/* The connection of a world to a process of this role. */
static DcdConnectionId find(DcdWorld world, DcdRole role)
{
    DcdConnectionId all[16], found = { 0 };
    size_t count = 0;
    OK(dcd_connections(world, all, 16, &count));
    for (size_t i = 0; i < count; i++) {
        DcdConnectionInfo info = DCD_CONNECTION_INFO_INIT;
        OK(dcd_connection_info(world, all[i], &info));
        if (info.role == role)
            found = all[i];
    }
    return found;
}

static void who_is_there(void)
{
    Heard heard = { 0 };
    DcdConnectionId all[4], few[1] = { { 0 } };
    DcdConnectionInfo info = DCD_CONNECTION_INFO_INIT;
    DcdWorldInfo own = DCD_WORLD_INFO_INIT;
    size_t count = 0;
    HEAR(server, &heard, heard.came == 4);
    HOLDS(heard.lost == 0 && heard.back == 0 && heard.gone == 0);
    FAILS(dcd_connections(server, few, 1, &count), DCD_ERR_SMALL_BUFFER, "room");
    HOLDS(count == 4 && few[0].v == 0);
    OK(dcd_connections(server, all, 4, &count));
    for (size_t i = 0; i < count; i++) {
        OK(dcd_connection_info(server, all[i], &info));
        HOLDS(info.state == DCD_CONNECTION_CAME && info.loss >= 0.0f && info.loss <= 1.0f && info.age > 0.0);
        HOLDS((info.node != 0) == (info.role != DCD_ROLE_CLIENT));
        HOLDS((info.client != 0) == (info.role != DCD_ROLE_NODE));
    }
    HOLDS(find(server, DCD_ROLE_SERVER).v == 0);
    OK(dcd_world_info(client, &own));
    OK(dcd_connection_info(server, find(server, DCD_ROLE_CLIENT), &info));
    HOLDS(info.client == own.client);

    DcdWorld others[] = { nodes[0], nodes[1], client, participant };
    for (int i = 0; i < 4; i++) {
        Heard own_news = { 0 };
        HEAR(others[i], &own_news, own_news.came > 0);
        DcdConnectionId upwards = find(others[i], DCD_ROLE_SERVER);
        do {
            hear(others[i], &own_news);
            OK(dcd_connection_info(others[i], upwards, &info));
        } while (info.bytes_in == 0 || info.rtt <= 0.0);
        HOLDS(info.udp_bytes_in > 0 && info.udp_bytes_out > 0);
        HOLDS(info.role == DCD_ROLE_SERVER && info.node == 0 && info.client == 0 && info.rtt < 10.0);
        HOLDS(info.bytes_out > 0 && info.messages_in > 0 && info.messages_out > 0);
        FAILS(dcd_connection_info(server, upwards, &info), DCD_ERR_STALE_ID, "connection");
    }
    /* A client is also connected to the leader of its avatars. */
    Heard news = { 0 };
    HEAR(client, &news, find(client, DCD_ROLE_NODE).v != 0);
    OK(dcd_connections(local, NULL, 0, &count));
    HOLDS(count == 0);
}

static void what_programs_say(void)
{
    DcdConnectionId to_client = find(server, DCD_ROLE_CLIENT), to_server = find(client, DCD_ROLE_SERVER);
    Heard at_server = { 0 }, at_client = { 0 };
    OK(dcd_send(client, to_server, "hello", 5, 0));
    HEAR(server, &at_server, at_server.messages == 1);
    HOLDS(at_server.last.size == 5 && memcmp(at_server.bytes, "hello", 5) == 0);
    HOLDS(at_server.last.role == DCD_ROLE_CLIENT && at_server.last.connection.v == to_client.v);
    HOLDS(at_server.last.client != 0 && at_server.last.node == 0);
    /* The answer goes back over the connection of the message. It is empty, which is allowed. */
    OK(dcd_send(server, at_server.last.connection, NULL, 0, 0));
    HEAR(client, &at_client, at_client.messages == 1);
    HOLDS(at_client.last.size == 0 && at_client.last.data == NULL && at_client.last.role == DCD_ROLE_SERVER);

    /* Messages of all sizes arrive in order. */
    static unsigned char longest[DCD_MAX_MESSAGE];
    memset(longest, 7, sizeof longest);
    uint32_t next = 0;
    for (uint32_t i = 0; i < 200; i++) {
        memcpy(longest, &i, sizeof i);
        size_t size = i % 50 == 0 ? sizeof longest : sizeof i + i;
        while (dcd_send(server, to_client, longest, size, 0) == DCD_ERR_BUSY)
            hear(client, &at_client);
    }
    for (int tries = 0; next < 200 && tries < 30000; tries++) {
        DcdEventView events = DCD_EVENT_VIEW_INIT;
        dcd_poll(client, 1000);
        OK(dcd_step(client));
        OK(dcd_events(client, &events));
        for (size_t i = 0; i < events.message_count; i++) {
            uint32_t number = 0;
            memcpy(&number, events.messages[i].data, sizeof number);
            next = number == next || (next == 0 && at_client.messages > 1) ? number + 1 : UINT32_MAX / 2;
        }
    }
    HOLDS(next == 200);

    /* Messages of every role. */
    struct {
        DcdWorld world;
        DcdRole role;
    } others[] = { { nodes[0], DCD_ROLE_NODE }, { participant, DCD_ROLE_PARTICIPANT } };
    for (int i = 0; i < 2; i++) {
        Heard there = { 0 };
        at_server = (Heard){ 0 };
        OK(dcd_send(others[i].world, find(others[i].world, DCD_ROLE_SERVER), "report", 6, 0));
        HEAR(server, &at_server, at_server.messages == 1);
        HOLDS(at_server.last.role == others[i].role && at_server.last.node != 0);
        OK(dcd_send(server, at_server.last.connection, "thanks", 6, 0));
        HEAR(others[i].world, &there, there.messages == 1);
        HOLDS(memcmp(there.bytes, "thanks", 6) == 0);
    }

    /* A datagram may be lost; of many, at least one arrives. */
    for (int tries = 0; tries < 1000 && at_client.datagrams == 0; tries++) {
        OK(dcd_send(server, to_client, longest, DCD_MAX_DATAGRAM, DCD_SEND_UNRELIABLE));
        hear(client, &at_client);
    }
    HOLDS(at_client.datagrams > 0 && at_client.last.size == DCD_MAX_DATAGRAM);

    DcdWorld none = { 0 };
    DcdConnectionId nobody = { 0 }, leader = find(client, DCD_ROLE_NODE);
    char letter = 'x';
    FAILS(dcd_send(none, to_client, &letter, 1, 0), DCD_ERR_NULL, "world");
    FAILS(dcd_send(server, nobody, &letter, 1, 0), DCD_ERR_NULL, "connection");
    FAILS(dcd_send(server, to_client, NULL, 1, 0), DCD_ERR_NULL, "data");
    FAILS(dcd_send(server, to_client, &letter, 1, 2), DCD_ERR_ARGUMENT, "flags");
    FAILS(dcd_send(server, to_client, longest, DCD_MAX_MESSAGE + 1, 0), DCD_ERR_ARGUMENT, "DCD_MAX_MESSAGE");
    FAILS(dcd_send(server, to_client, longest, DCD_MAX_DATAGRAM + 1, 1), DCD_ERR_ARGUMENT, "DCD_MAX_DATAGRAM");
    FAILS(dcd_send(server, to_client, longest, SIZE_MAX, 0), DCD_ERR_ARGUMENT, "DCD_MAX_MESSAGE");
    FAILS(dcd_send(server, to_server, &letter, 1, 0), DCD_ERR_STALE_ID, "connection");
    FAILS(dcd_send(client, leader, &letter, 1, 0), DCD_ERR_UNSUPPORTED, "server");
    FAILS(dcd_send(local, to_client, &letter, 1, 0), DCD_ERR_UNSUPPORTED, "local");
}

/* A program that makes no steps blocks those that write to it, and nobody else. */
static void a_full_queue(void)
{
    static const char page[10000];
    DcdConnectionId to_node = find(server, DCD_ROLE_NODE), to_client = find(server, DCD_ROLE_CLIENT);
    DcdWorldInfo before = DCD_WORLD_INFO_INIT, after = DCD_WORLD_INFO_INIT;
    Heard heard = { 0 };
    unsigned sent = 0;
    /* Until waiting no longer makes room. */
    for (int refused = 0; refused < 50;) {
        DcdStatus status = dcd_send(server, to_client, page, sizeof page, 0);
        sent += status == DCD_OK;
        refused = status == DCD_ERR_BUSY ? refused + 1 : 0;
        HOLDS(status == DCD_OK || status == DCD_ERR_BUSY);
        dcd_poll(participant, 20);
        OK(dcd_step(participant));
    }
    HOLDS(sent * sizeof page > 200000 && sent * sizeof page < 300000);
    FAILS(dcd_send(server, to_client, page, sizeof page, 0), DCD_ERR_BUSY, "waits");
    OK(dcd_send(server, to_node, page, sizeof page, 0));
    OK(dcd_world_info(participant, &before));
    do {
        hear(participant, &heard);
        OK(dcd_world_info(participant, &after));
    } while (after.tick < before.tick + 10);
    heard = (Heard){ 0 };
    HEAR(client, &heard, heard.messages == sent);
    HOLDS(heard.last.size == sizeof page && heard.lost == 0 && heard.gone == 0);
    OK(dcd_send(server, to_client, page, sizeof page, 0));
    HEAR(client, &heard, heard.messages == sent + 1);
}

static DcdStatus waited;

static void *wait_long(void *unused)
{
    (void)unused;
    waited = dcd_poll(server, UINT32_MAX);
    return NULL;
}

static void waiting(void)
{
    pthread_t waiter;
    DcdWorld none = { 0 };
    Heard heard = { 0 };
    OK(dcd_poll(local, UINT32_MAX));
    FAILS(dcd_poll(none, 0), DCD_ERR_NULL, "world");
    while (dcd_poll(server, 0) == DCD_OK)
        hear(server, &heard);
    FAILS(dcd_poll(server, 1), DCD_ERR_TIMEOUT, "1 ms");
    /* A thread that waits blocks no other. */
    HOLDS(pthread_create(&waiter, NULL, wait_long, NULL) == 0);
    OK(dcd_step(server));
    OK(dcd_send(client, find(client, DCD_ROLE_SERVER), "wake up", 7, 0));
    OK(dcd_poll(server, 60000));
    HOLDS(pthread_join(waiter, NULL) == 0 && waited == DCD_OK);
    /* The message has not been taken in yet. */
    OK(dcd_poll(server, 0));
    OK(dcd_step(server));
    /* New states of the world wake a client. */
    OK(dcd_step(client));
    OK(dcd_poll(client, 60000));
}

static void sending_away(void)
{
    static char endless[DCD_MAX_REASON + 1];
    DcdConnectionId to_client = find(server, DCD_ROLE_CLIENT), to_server = find(client, DCD_ROLE_SERVER);
    DcdConnectionInfo info = DCD_CONNECTION_INFO_INIT;
    Heard at_server = { 0 }, heard = { 0 };
    memset(endless, 'x', DCD_MAX_REASON);
    FAILS(dcd_disconnect(server, to_client, endless), DCD_ERR_ARGUMENT, "DCD_MAX_REASON");
    FAILS(dcd_disconnect(client, to_server, NULL), DCD_ERR_UNSUPPORTED, "leave");
    FAILS(dcd_disconnect(local, to_client, NULL), DCD_ERR_UNSUPPORTED, "local");
    FAILS(dcd_disconnect(server, to_server, NULL), DCD_ERR_STALE_ID, "connection");

    /* Messages sent before the disconnection arrive. */
    OK(dcd_send(server, to_client, "goodbye", 7, 0));
    OK(dcd_disconnect(server, to_client, "cheating"));
    HEAR(server, &at_server, at_server.gone == 1);
    HOLDS(at_server.ended.role == DCD_ROLE_CLIENT && at_server.ended.connection.v == to_client.v);
    HOLDS(strstr(at_server.ended.reason, "cheating") != NULL && at_server.ended.cause == DCD_CAUSE_SENT_AWAY);
    FAILS(dcd_connection_info(server, to_client, &info), DCD_ERR_STALE_ID, "connection");
    FAILS(dcd_send(server, to_client, "x", 1, 0), DCD_ERR_STALE_ID, "connection");
    for (int tries = 0; tries < 30000 && hear(client, &heard) == DCD_OK; tries++) {
    }
    FAILS(dcd_step(client), DCD_ERR_NETWORK, "cheating");
    HOLDS(heard.messages == 1 && memcmp(heard.bytes, "goodbye", 7) == 0 && heard.gone > 0);
    HOLDS(heard.ended.cause == DCD_CAUSE_SENT_AWAY);
    FAILS(dcd_send(client, to_server, "x", 1, 0), DCD_ERR_STALE_ID, "connection");
    OK(dcd_poll(client, UINT32_MAX));

    /* A node hands its regions over first. */
    DcdConnectionId to_node = { 0 }, all[8];
    size_t count = 0;
    OK(dcd_connections(nodes[0], all, 8, &count));
    HOLDS(find(nodes[0], DCD_ROLE_PARTICIPANT).v != 0);
    to_node = find(server, DCD_ROLE_NODE);
    OK(dcd_disconnect(server, to_node, NULL));
    HEAR(server, &at_server, at_server.gone == 2);
    HOLDS(at_server.ended.role == DCD_ROLE_NODE && at_server.ended.cause == DCD_CAUSE_SENT_AWAY);
    DcdWorld gone = { 0 };
    for (int tries = 0; tries < 30000 && gone.v == 0; tries++) {
        for (int i = 0; i < 2; i++) {
            Heard ignored = { 0 };
            if (dcd_poll(nodes[i], 1) == DCD_OK && hear(nodes[i], &ignored) != DCD_OK)
                gone = nodes[i];
        }
    }
    FAILS(dcd_step(gone), DCD_ERR_NETWORK, "no reason is given");
    DcdWorldInfo before = DCD_WORLD_INFO_INIT, after = DCD_WORLD_INFO_INIT;
    OK(dcd_world_info(participant, &before));
    do {
        hear(participant, &heard);
        OK(dcd_world_info(participant, &after));
    } while (after.tick < before.tick + 10);
}

/* A process that leaves by itself is told apart from one that is sent away and from one that dies. */
static void leaving(void)
{
    DcdClientDef play = DCD_CLIENT_DEF_INIT;
    DcdWorld passer_by = { 0 };
    Heard heard = { 0 };
    play.server = address;
    play.token = token;
    mint(DCD_ROLE_CLIENT);
    OK(dcd_client_connect(&play, &passer_by));
    OK(dcd_world_destroy(passer_by));
    HEAR(server, &heard, heard.gone == 1);
    HOLDS(heard.ended.role == DCD_ROLE_CLIENT && heard.ended.cause == DCD_CAUSE_LEFT);
    /* One of the two nodes has been sent away before. */
    OK(dcd_world_destroy(nodes[0]));
    OK(dcd_world_destroy(nodes[1]));
    HEAR(server, &heard, heard.gone == 2);
    HOLDS(heard.ended.role == DCD_ROLE_NODE && heard.ended.cause == DCD_CAUSE_LEFT);
    HOLDS(strcmp(heard.ended.reason, "it has left") == 0 && heard.lost == 0);
}

int main(int argc, char **argv)
{
    if (argc != 2)
        return 2;
    start(argv[1]);
    who_is_there();
    what_programs_say();
    a_full_queue();
    waiting();
    sending_away();
    leaving();

    /* The end of the world is told last. */
    Heard heard = { 0 };
    OK(dcd_world_destroy(client));
    OK(dcd_world_destroy(server));
    while (hear(participant, &heard) == DCD_OK) {
    }
    size_t count = 1;
    OK(dcd_connections(participant, NULL, 0, &count));
    HOLDS(heard.gone > 0 && count == 0 && heard.ended.cause == DCD_CAUSE_WORLD_ENDED);
    OK(dcd_world_destroy(participant));
    OK(dcd_world_destroy(local));
    return checked();
}
