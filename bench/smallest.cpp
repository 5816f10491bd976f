// The smallest program with a component, for the size of its binary (bench/compile).
#include <ise/ise.hpp>

class nobody : public ise::component {
    ise::task<> run() override { co_return; }
};

int main() {
    ise::real_environment env;
    ise::node node(env);
    node.start<nobody>("bench/nobody");
    return ise::run_until_signal(node);
}
