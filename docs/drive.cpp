// Steps a scene without its hand, as one FMU, for 3 s at 512 Hz: a control computer reads the hand's force before each
// step, and sends the motors' afterwards. Here the hand pulls by 0.5 N, and the pose of the mechanism is printed.
#include "fmi2Functions.h"

#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <regex>
#include <string>

static void log(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String text, ...) {
    va_list arguments;
    va_start(arguments, text);
    std::vfprintf(stderr, text, arguments);
    va_end(arguments);
}

static void check(fmi2Status status) {
    if (status > fmi2Warning) std::exit(1);  // `log` has printed why
}

int main() {
    std::ifstream file("one/modelDescription.xml");
    const std::string xml(std::istreambuf_iterator<char>(file), {});
    auto find = [&](const std::string &pattern) {
        std::smatch found;
        if (!std::regex_search(xml, found, std::regex(pattern))) std::exit(2);
        return found[1].str();
    };
    auto reference = [&](const std::string &name) {
        return fmi2ValueReference(std::stoul(find("name=\"" + name + "\" valueReference=\"(\\d+)\"")));
    };
    auto vector = [&](const std::string &name) {
        return std::array{reference(name + "\\[1\\]"), reference(name + "\\[2\\]"), reference(name + "\\[3\\]")};
    };
    const auto force = vector("hand.F"), pose = vector("virtual_mechanism.x");
    const std::string guid = find("guid=\"([^\"]+)\"");
    const fmi2CallbackFunctions callbacks{log, std::calloc, std::free, nullptr, nullptr};
    fmi2Component scene =
        fmi2Instantiate("scene", fmi2CoSimulation, guid.c_str(), "", &callbacks, fmi2False, fmi2False);
    if (!scene) return 3;
    check(fmi2SetupExperiment(scene, fmi2False, 0, 0, fmi2False, 0));
    check(fmi2EnterInitializationMode(scene));
    const fmi2Real wrench[3] = {0.5, 0.0, 0.0}, h = 1.0 / 512;
    check(fmi2SetReal(scene, force.data(), 3, wrench));
    check(fmi2ExitInitializationMode(scene));
    for (int k = 0; k < 3 * 512; ++k) {
        check(fmi2SetReal(scene, force.data(), 3, wrench));
        check(fmi2DoStep(scene, k * h, h, fmi2True));
    }
    fmi2Real x[3];
    check(fmi2GetReal(scene, pose.data(), 3, x));
    std::printf("%.17g %.17g %.17g\n", x[0], x[1], x[2]);
    check(fmi2Terminate(scene));
    fmi2FreeInstance(scene);
}
