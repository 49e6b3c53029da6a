/* The board's states: sessions, configuration, ticks; see board.h. */
#include "board.h"

#include "frames.h"

static void forget(board *b) {
    config_clear(&b->config);
    b->answered = b->flying = false;
    b->timer_ns = HAL_FOREVER;
    b->next_tick = 0;
    b->stepped = 0;
}

void board_init(board *b, const hal *hal) {
    b->hal = hal;
    port_init(&b->port, hal);
    b->has_nonce = b->stopped = false;
    b->nonce = 0;
    b->clock_rate_q16 = 0;
    b->discarded_before = 0;
    forget(b);
}

/* -- session ---------------------------------------------------------------------------------------------------------- */

static void send_hello(board *b, uint8_t echo) {
    uint8_t *packet = port_begin(&b->port, HELLO_SIZE, TYPE_HELLO, NO_TICK);
    const char *build = b->hal->build;
    put_u16(packet + HELLO_PROTOCOL_VERSION_AT, PROTOCOL_VERSION);
    packet[HELLO_ROLE_AT] = ROLE_BOARD;
    packet[HELLO_FLAGS_AT] =
        (uint8_t)(echo | (b->hal->own_timer ? HELLO_OWN_TIMER : 0) | (b->flying ? HELLO_CONFIGURED : 0));
    put_u32(packet + HELLO_LAYOUT_HASH_AT, LAYOUT_HASH);
    put_u64(packet + HELLO_NONCE_AT, b->has_nonce ? b->nonce : 0);
    for (size_t i = 0; i < HELLO_BUILD_SIZE && build[i] != '\0'; i++) {
        packet[HELLO_BUILD_AT + i] = (uint8_t)build[i];
    }
    port_end(&b->port, packet, HELLO_SIZE);
    port_flush(&b->port);
}

void board_announce(board *b) {
    send_hello(b, 0);
}

static void on_hello(board *b, const uint8_t *packet) {
    if (packet[HELLO_ROLE_AT] != ROLE_LAB) {
        return;
    }
    uint64_t nonce = get_u64(packet + HELLO_NONCE_AT);
    if (!b->has_nonce || nonce != b->nonce) {
        forget(b);
        port_reset(&b->port);
        b->has_nonce = true;
        b->nonce = nonce;
        b->clock_rate_q16 = get_u32(packet + HELLO_CLOCK_RATE_Q16_AT);
        b->discarded_before = b->port.decoder.counters.discarded_bytes;
        b->stopped = false;
    }
    send_hello(b, HELLO_ECHO);
}

static void send_ready(board *b) {
    uint8_t *packet = port_begin(&b->port, READY_SIZE, TYPE_READY, NO_TICK);
    put_u16(packet + READY_STATUS_AT, b->ready.status);
    put_u16(packet + READY_INDEX_AT, b->ready.index);
    put_u32(packet + READY_TABLE_HASH_AT, b->ready.table_hash);
    port_end(&b->port, packet, READY_SIZE);
    port_flush(&b->port);
}

/* All parts have come: READY says whether a law flies with them. */
static void configure(board *b) {
    b->ready = config_check(&b->config);
    if (b->ready.status == READY_OK) {
        b->flying = flight_init(&b->flight, &b->config, &b->ready);
        if (!b->flying) {
            b->ready.status = READY_LAW_REFUSES;
            b->ready.table_hash = 0;
        }
    }
    b->answered = true;
}

static void on_config(board *b, const uint8_t *packet, size_t size) {
    if (!b->answered) {
        if (!config_add(&b->config, packet, size)) {
            return;
        }
        configure(b);
    }
    send_ready(b);
}

static void on_stop(board *b) {
    forget(b);
    b->has_nonce = false;
    b->stopped = true;
}

/* -- ticks ------------------------------------------------------------------------------------------------------------ */

static void put_command(board *b, const answer *a) {
    uint8_t *packet = port_begin(&b->port, COMMAND_SIZE, TYPE_COMMAND, b->next_tick);
    put_words(packet + COMMAND_TORQUE_AT, a->torque, 3);
    put_u16(packet + COMMAND_FLAGS_AT, a->flags);
    packet[COMMAND_FOLLOWS_AT] = (uint8_t)((a->words_count != 0) + b->flight.events_count);
    packet[COMMAND_USED_AT] = a->used;
    port_end(&b->port, packet, COMMAND_SIZE);
}

static void put_telemetry(board *b, const answer *a) {
    size_t size = TELEMETRY_SIZE + 4 * a->words_count;
    uint8_t *packet = port_begin(&b->port, size, TYPE_TELEMETRY, b->next_tick);
    put_u16(packet + TELEMETRY_LAW_ID_AT, b->flight.table->id);
    put_u16(packet + TELEMETRY_LAW_VERSION_AT, b->flight.table->version);
    put_words(packet + TELEMETRY_SIZE - CRC_SIZE, a->words, a->words_count);
    port_end(&b->port, packet, size);
}

static void put_event(board *b, const event *e) {
    uint8_t *packet = port_begin(&b->port, EVENT_SIZE, TYPE_EVENT, b->next_tick);
    put_u16(packet + EVENT_CODE_AT, e->code);
    put_i32(packet + EVENT_A_AT, e->a);
    put_i32(packet + EVENT_B_AT, e->b);
    port_end(&b->port, packet, EVENT_SIZE);
}

/* How the board fares: the time since began_ns went into this answer. */
static void put_timing(board *b, int64_t began_ns) {
    const volatile struct hal_health *health = b->hal->health;
    int64_t busy_ns = b->hal->now(b->hal->self) - began_ns;
    uint8_t *packet = port_begin(&b->port, TIMING_SIZE, TYPE_TIMING, b->next_tick);
    put_u32(packet + TIMING_BUSY_AT, busy_ns < UINT32_MAX ? (uint32_t)busy_ns : UINT32_MAX);
    put_u32(packet + TIMING_STACK_AT, health->stack_bytes);
    put_u32(packet + TIMING_RX_ERRORS_AT, health->rx_errors);
    put_u32(packet + TIMING_DISCARDED_AT, b->port.decoder.counters.discarded_bytes - b->discarded_before);
    port_end(&b->port, packet, TIMING_SIZE);
}

/* The next tick, exactly once, and its answer in one write. */
static void step(board *b, const sample *s) {
    bool timed = ++b->stepped % TIMING_EVERY == 0 && b->hal->health != NULL;
    int64_t began_ns = timed ? b->hal->now(b->hal->self) : 0;
    answer *a = &b->answer;
    flight_step(&b->flight, b->next_tick, s, a);
    put_command(b, a);
    if (a->words_count != 0) {
        put_telemetry(b, a);
    }
    for (size_t i = 0; i < b->flight.events_count; i++) {
        put_event(b, &b->flight.events[i]);
    }
    flight_answered(&b->flight);
    if (timed) {
        put_timing(b, began_ns);
    }
    port_flush(&b->port);
    b->next_tick++;
}

/* floor(us * 1000 * 65536 / rate): a simulated duration on the board's clock; what does not fit is for ever. */
static int64_t wall_ns(int64_t simulated_us, uint32_t rate_q16) {
    const int64_t one = INT64_C(1000) * 65536;
    int64_t whole = simulated_us / rate_q16, rest = simulated_us % rate_q16;
    return whole < INT64_MAX / one - 1 ? whole * one + rest * one / rate_q16 : HAL_FOREVER;
}

static int64_t later(int64_t ns, int64_t by_ns) {
    return by_ns < HAL_FOREVER - ns ? ns + by_ns : HAL_FOREVER;
}

/* The SAMPLE of next_tick is expected so many periods from now. Each SAMPLE re-phases the timer, so clock drift accumulates
 * only in gaps. A stale one does too: a laboratory that stood still finds the board ahead, and the board then waits for it. */
static void phase_timer(board *b, uint32_t ticks) {
    if (b->clock_rate_q16 != 0 && b->hal->own_timer) {
        int64_t simulated_us = ticks * b->flight.period_us + b->flight.sample_timeout_us;
        b->timer_ns = later(b->hal->now(b->hal->self), wall_ns(simulated_us, b->clock_rate_q16));
    }
}

static void on_timer(board *b) {
    if (b->next_tick == NO_TICK) { /* the last tick there is was stepped */
        b->timer_ns = HAL_FOREVER;
        return;
    }
    b->timer_ns = later(b->timer_ns, wall_ns(b->flight.period_us, b->clock_rate_q16));
    step(b, NULL);
}

/* Too far ahead to propagate: the ticks between are never answered. */
static void catch_up(board *b, uint32_t tick) {
    if (tick - b->next_tick > AHEAD_LIMIT) {
        flight_restart(&b->flight, b->next_tick, tick);
        b->next_tick = tick;
    }
    while (b->next_tick < tick) {
        step(b, NULL);
    }
}

static void on_sample(board *b, const uint8_t *packet) {
    if (!b->flying) {
        send_hello(b, 0);
        return;
    }
    uint32_t tick = get_u32(packet + HEADER_TICK_AT);
    if (tick < b->next_tick) {
        flight_count_dropped(&b->flight, tick);
        phase_timer(b, b->next_tick - tick);
        return;
    }
    sample_read(packet, &b->sample);
    catch_up(b, tick);
    step(b, &b->sample);
    phase_timer(b, 1);
}

/* TICK(k), sent in lockstep where no valid SAMPLE(k) survived the link: step up to and including k. */
static void on_tick(board *b, const uint8_t *packet) {
    if (!b->flying) {
        send_hello(b, 0);
        return;
    }
    uint32_t tick = get_u32(packet + HEADER_TICK_AT);
    if (tick >= b->next_tick) {
        catch_up(b, tick);
        step(b, NULL);
    }
}

/* -- main loop -------------------------------------------------------------------------------------------------------- */

/* One frame from the laboratory, whatever the state. Those that only a board sends are ignored. */
static void handle(board *b, const uint8_t *packet, size_t size) {
    uint8_t type = packet_type(packet);
    bool from_lab = type == TYPE_CONFIG || type == TYPE_SAMPLE || type == TYPE_TICK || type == TYPE_STOP;
    if (type == TYPE_HELLO) {
        on_hello(b, packet);
    } else if (!b->has_nonce && from_lab) {
        send_hello(b, 0);
    } else if (type == TYPE_CONFIG) {
        on_config(b, packet, size);
    } else if (type == TYPE_SAMPLE) {
        on_sample(b, packet);
    } else if (type == TYPE_TICK) {
        on_tick(b, packet);
    } else if (type == TYPE_STOP) {
        on_stop(b);
    }
}

bool board_round(board *b) {
    const hal *hal = b->hal;
    size_t size = 0;
    hal->kick(hal->self);
    const uint8_t *packet = port_next(&b->port, &size);
    if (packet == NULL) {
        if (!hal->wait(hal->self, b->timer_ns)) {
            return false;
        }
        packet = port_receive(&b->port, &size);
    }
    if (packet != NULL) {
        handle(b, packet, size);
    } else if (b->timer_ns != HAL_FOREVER && hal->now(hal->self) >= b->timer_ns) {
        on_timer(b);
    }
    return true;
}

void board_serve(board *b, bool once) {
    board_announce(b);
    while (!(once && b->stopped) && board_round(b)) {
    }
}
