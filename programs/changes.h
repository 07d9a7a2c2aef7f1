/* Changes of a program that runs: holds and latencies of connections, and the rate of a clock, as
 * orchestrator/real_time_session.py has them of a run. Part of program.c. */

static int64_t previous(const Model *m, int clock) {
    const Clock *c = m->now.scene.events.clocks + clock;
    if (c->at) return c->starts[c->at - 1];
    if (!patterns[clock].n || !m->now.scene.events.events) return 0;
    return c->starts[patterns[clock].n - 2] - patterns[clock].ticks;
}

/* --- holds ----------------------------------------------------------------------------------- */

/* Has the loop use the holds that were chosen. */
static void use_chosen(Model *m) {
    const Changes *now = &m->now.changes;
    Hold **in_loop = m->now.scene.loop.holds;
    for (int k = 0; k < N_HOLDS; k++) {
        if (!now->chosen[k]) continue;
        in_loop[k] = ALTERNATIVES(&m->now.scene)[now->chosen[k] - 1];
        if (now->delay[k] < 0 ? !own_latency[k] : !now->delay[k]) in_loop[k]->link = NULL;
    }
}

/* Gives a connection another hold, which begins anew with the newest sample, and a latency, -1 for that
 * of the scene. */
static int change_hold(Model *m, int choice, int64_t microseconds) {
    const int k = choices[choice].hold;
    Scene *s = &m->now.scene;
    Loop *l = &s->loop;
    for (int i = 0; i < choices[choice].n; i++) {
        const size_t at = choice_regions[choices[choice].first + i].at;
        const size_t size = choice_regions[choices[choice].first + i].size;
        memcpy((char *)s + at, (const char *)&initial + at, size);
    }
    const double ticks = (double)microseconds * l->denominator / (1e6 * l->numerator);
    m->now.changes.chosen[k] = choice + 1;
    m->now.changes.delay[k] = microseconds < 0 ? -1 : (int64_t)ceil(ticks);
    relocate(m);
    if (m->now.mode != STEP_MODE) return 1;
    Hold *h = l->holds[k];
    double *sample = hold_scratch(h);
    const int64_t stamp = previous(m, hold_clocks[k]);
    for (int64_t i = 0; i < h->width; i++) sample[i] = l->values[h->sources[i]];
    return !hapticlink_push(h, sample, stamp, stamp);
}

/* --- rate ------------------------------------------------------------------------------------- */

/* What data of the scene are at its begin. */
static const void *at_begin(const Model *m, const void *data) {
    return (const char *)&initial + ((const char *)data - (const char *)&m->now.scene);
}

/* Communication point `index` of the scene's own steps, which have a pattern. */
static int64_t own_point(const Model *m, int64_t index) {
    const Clock *c = m->now.scene.events.clocks + CHANGED_CLOCK, *own = at_begin(m, c);
    const Pattern *p = patterns + CHANGED_CLOCK;
    const int64_t *starts = at_begin(m, c->starts), phase = own->n - p->n;
    const int64_t rounds = index < phase ? 0 : (index - phase) / (p->n - 1);
    return starts[index - rounds * (p->n - 1)] + rounds * p->ticks;
}

/* Communication point `index` after the change, at a haptic tick; a tick is numerator/denominator s. */
static int64_t rated_point(Model *m, int64_t index, int64_t before) {
    Changes *now = &m->now.changes;
    const Loop *l = &m->now.scene.loop;
    if (now->millihertz == OWN_RATE) return own_point(m, index);
    const int64_t per = now->millihertz * (int64_t)l->numerator, haptic = HAPTIC_TICKS;
    const int64_t ticks = now->begun * per + index * 1000 * (int64_t)l->denominator;
    int64_t point = (ticks + per * haptic - 1) / (per * haptic) * haptic;
    if (now->jitter > 0.0) {
        const double late = now->jitter * (uniform(&now->generator) - 0.5) * 1000.0 * l->denominator;
        point = (int64_t)ceil(((double)ticks + late) / (double)(per * haptic)) * haptic;
    }
    return point > before ? point : before + haptic;
}

static void fill_window(Model *m, Clock *c, int64_t from) {
    int64_t *starts = (int64_t *)c->starts;
    for (int64_t i = from; i < c->n; i++)
        starts[i] = rated_point(m, ++m->now.changes.index, starts[i - 1]);
}

/* From the end of the current step on; before the start, from t = 0 on. */
static void change_rate(Model *m, int64_t millihertz, double jitter) {
    Changes *now = &m->now.changes;
    Clock *c = m->now.scene.events.clocks + CHANGED_CLOCK;
    int64_t *starts = (int64_t *)c->starts;
    const int64_t before = previous(m, CHANGED_CLOCK), begun = starts[c->at];
    const int begins = m->now.mode == STEP_MODE && begun > 0;
    now->millihertz = millihertz ? millihertz : OWN_RATE;
    now->jitter = jitter;
    now->begun = begins ? begun : 0;
    now->index = 0;
    now->generator.state[1] += 0x9e3779b97f4a7c15;
    now->generator.increment[1] = 1;
    if (c->n > MOST_POINTS) c->n = MOST_POINTS;
    starts[0] = before;
    if (begins) starts[1] = begun;
    else starts[0] = 0;
    c->at = begins;
    while (begins && !millihertz && own_point(m, now->index + 1) < begun + HAPTIC_TICKS) now->index++;
    fill_window(m, c, 1 + begins);
}

/* Moves the window of the changed clock on; 0 for other clocks. */
static int next_rated_window(Model *m, Clock *c) {
    int64_t *starts = (int64_t *)c->starts;
    if (!m->now.changes.millihertz || c != m->now.scene.events.clocks + CHANGED_CLOCK) return 0;
    starts[0] = starts[c->at - 1];
    starts[1] = starts[c->at];
    c->at = 1;
    fill_window(m, c, 2);
    return 1;
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
