/* What a program has in store for changes while it runs: alternative holds of connections, and kinds of events at any
 * rate of a clock. The changes themselves are those of the loop, changes.c. Part of program.c. */

/* What data of the scene are at its begin. */
static const void *at_begin(const Model *m, const void *data) {
    return (const char *)&initial + ((const char *)data - (const char *)&m->now.scene);
}

/* --- holds ----------------------------------------------------------------------------------- */

/* Has the loop use the holds that were chosen. */
static void use_chosen(Model *m) {
    const Changes *now = &m->now.changes;
    Hold **in_loop = m->now.scene.loop.holds;
    for (int k = 0; k < N_HOLDS; k++) {
        if (!now->chosen[k]) continue;
        in_loop[k] = ALTERNATIVES(&m->now.scene)[now->chosen[k] - 1];
        if (now->direct[k]) in_loop[k]->link = NULL;
    }
}

/* Gives a connection another hold, as it is at the begin, and a latency, -1 for that of the scene. */
static int choose_hold(Model *m, int choice, int64_t microseconds) {
    const int k = choices[choice].hold;
    Scene *s = &m->now.scene;
    Loop *l = &s->loop;
    const int64_t published = l->holds[k]->published, describes = l->holds[k]->describes;
    for (int i = 0; i < choices[choice].n; i++) {
        const size_t at = choice_regions[choices[choice].first + i].at;
        const size_t size = choice_regions[choices[choice].first + i].size;
        memcpy((char *)s + at, (const char *)&initial + at, size);
    }
    m->now.changes.chosen[k] = choice + 1;
    m->now.changes.direct[k] = microseconds < 0 ? !own_latency[k] : !microseconds;
    relocate(m);
    Hold *h = l->holds[k];
    h->published = published; /* the source's newest sample is the one that it was */
    h->describes = describes;
    if (microseconds > 0) {
        const double ticks = (double)microseconds * l->denominator / (1e6 * l->numerator);
        h->link->low = (int64_t)ceil(ticks);
        h->link->spread = 0;
        h->link->unit = 1;
        h->link->loss = 0.0;
    }
    if (m->now.mode != STEP_MODE) return 1;
    return !hapticlink_change_hold(l, k, h, s->events.clocks[hold_clocks[k]].last);
}

/* --- rate ------------------------------------------------------------------------------------- */

/* The scene's own communication points of a clock in a round of their pattern; 0 where they end. */
static int own_points(Model *m, int clock, int64_t round) {
    Clock *c = m->now.scene.events.clocks + clock;
    const Clock *own = at_begin(m, c);
    const Pattern *p = patterns + clock;
    if (round && !p->n) return 0;
    const int64_t *points = at_begin(m, c->starts);
    const int64_t phase = round ? own->n - p->n : 0; /* 1 where the first step is none of the pattern's */
    int64_t *starts = (int64_t *)c->starts;
    c->n = own->n - phase;
    for (int64_t i = 0; i < c->n; i++) starts[i] = points[i + phase] + round * p->ticks;
    c->at = 0;
    m->now.changes.round[clock] = round;
    return 1;
}

/* Lets steps end where the scene has it, the first at least a haptic tick after the current one. */
static void restore_rate(Model *m) {
    Clock *c = m->now.scene.events.clocks + CHANGED_CLOCK;
    int64_t *starts = (int64_t *)c->starts, round = 0;
    const int64_t current = starts[c->at], first = current + HAPTIC_TICKS;
    c->rate.parts = 0;
    while (own_points(m, CHANGED_CLOCK, round++) && starts[c->n - 1] < first) {}
    while (c->at < c->n - 1 && starts[c->at] < first) c->at++;
    starts[--c->at] = current;
}

/* From the end of the current step on; 0 for the scene's own rate. */
static void change_rate(Model *m, int64_t millihertz, double jitter) {
    const Loop *l = &m->now.scene.loop;
    Clock *c = m->now.scene.events.clocks + CHANGED_CLOCK;
    if (!millihertz) {
        restore_rate(m);
        return;
    }
    const int64_t parts = millihertz * (int64_t)l->numerator, ticks = 1000 * (int64_t)l->denominator;
    Rate rate = {ticks / parts, ticks % parts, parts, HAPTIC_TICKS, jitter, c->rate.generator};
    rate.generator.state[1] += 0x9e3779b97f4a7c15;
    rate.generator.increment[1] = 1;
    hapticlink_change_rate(c, &rate);
}

/* --- kinds of events -------------------------------------------------------------------------- */

static void derive(const Loop *l, const Family *f, int64_t dticks, Op *ops) {
    for (int64_t i = 0; i < f->n; i++) {
        Op *op = ops + i;
        const int64_t further = dticks - f->dticks;
        *op = l->ops[f->first + i];
        op->b += slopes[f->slopes + i].b * further;
        op->c += slopes[f->slopes + i].c * further;
        op->d += slopes[f->slopes + i].d * further;
        if (slopes[f->slopes + i].x == 0.0) continue;
        if (op->code == STEP) op->x = (double)dticks * l->numerator / (l->denominator * (double)op->c);
        else op->x += slopes[f->slopes + i].x * (double)further;
    }
}

/* Makes an event's kind of that family in which the changed clock takes steps of any length; 0 where
 * there is none. */
static int new_kind(Model *m) {
    Events *e = &m->now.scene.events;
    Loop *l = &m->now.scene.loop;
    for (int k = 0; k < N_FAMILIES; k++) {
        int same = e->key[1 + CHANGED_CLOCK] > 0;
        for (int i = 0; i <= N_CLOCKS; i++)
            same = same && (i == 1 + CHANGED_CLOCK || families[k].key[i] == e->key[i]);
        if (!same) continue;
        const int64_t spare = m->now.changes.kinds++ % N_SPARE;
        const int64_t slot = e->n_kinds - N_SPARE + spare, first = SPARE_OP + spare * SPARE_OPS;
        derive(l, families + k, e->key[1 + CHANGED_CLOCK] / 2, l->ops + first);
        memcpy(e->keys + slot * (1 + N_CLOCKS), e->key, (1 + N_CLOCKS) * sizeof *e->key);
        e->kinds[slot].last = first + families[k].n;
        return 1;
    }
    return 0;
}
