/* Latencies as Link.draw of orchestrator/system/latency_and_loss.py draws them, with whole numbers throughout.
 * Part of program.c. */

/* PCG64 as NumPy has it, with a state and an increment of 128 bits each, the high words first. */
typedef struct {
    uint64_t state[2], increment[2];
} Pcg64;

/* A latency is drawn: ceil((low + spread u) / unit) ticks, u uniform from 0 to 1 and before it the
 * sample is lost with a probability `loss`; all but that are whole numbers. */
typedef struct {
    int64_t hold;
    uint64_t low, spread, unit;
    double loss;
    Pcg64 generator;
} Latency;

/* A uniform number from 0 to 1, times 2^53 (O'Neill, PCG, HMC-CS-2014-0905: XSL RR 128/64; numpy's
 * Generator.random). */
static uint64_t random_bits(Pcg64 *g) {
    const __uint128_t multiplier = (__uint128_t)2549297995355413924u << 64 | 4865540595714422341u;
    const __uint128_t before = (__uint128_t)g->state[0] << 64 | g->state[1];
    const __uint128_t increment = (__uint128_t)g->increment[0] << 64 | g->increment[1];
    const __uint128_t state = before * multiplier + increment;
    g->state[0] = (uint64_t)(state >> 64);
    g->state[1] = (uint64_t)state;
    const uint64_t folded = g->state[0] ^ g->state[1], turn = g->state[0] >> 58;
    return (folded >> turn | folded << (-turn & 63)) >> 11;
}

/* The next latency (ticks), -1 for a lost sample. */
static int64_t latency_draw(const Latency *latency, Pcg64 *generator) {
    const uint64_t share = random_bits(generator), luck = random_bits(generator);
    if ((double)luck * 0x1p-53 < latency->loss) return -1;
    /* ceil(N / (unit 2^53)), N = low 2^53 + spread share. A division of 128 bits would call a
     * function of the compiler's library. */
    const __uint128_t product = (__uint128_t)latency->spread * share;
    const uint64_t whole = latency->low + (uint64_t)(product >> 53);
    const uint64_t rest = (uint64_t)product & ((1ull << 53) - 1);
    return (int64_t)(whole / latency->unit + (whole % latency->unit || rest));
}

/* A uniform number from 0 to 1. */
static double uniform(Pcg64 *generator) { return (double)random_bits(generator) * 0x1p-53; }
