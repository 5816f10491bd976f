// Parameters of a component while it runs: others read them, change them, and are refused.
#include <unit/component/sea.hpp>

#include <ise/component/component_type.hpp>
#include <ise/component/nearest.hpp>

namespace live_test {

using namespace sea;
using ise::component;
using ise_test::Contains;

namespace {

struct wind_options {
    double speed = 6;
    std::int32_t from = 45;
    bool gusts = true;
    std::uint64_t seed = 1;
    std::string name = "trade";
};

/// Keeps what it was told of, and has something against gales.
class wind final : public component {
public:
    explicit wind(wind_options options) : options_(std::move(options)) {}

    void change(const wind_options& now) {
        if (now.speed > 30) throw ise::error(ise::errc::refused, "no gales");
        if (now.from == 180) throw std::runtime_error("south is out");
        options_ = now;
        heard.push_back(now);
    }

    static inline std::vector<wind_options> heard;

private:
    task<> run() override {
        provide(echo, [this](question) { return reply{std::to_string(options_.speed)}; });
        co_return;
    }

    wind_options options_;
};

ise::component_type wind_type(std::shared_ptr<wind_options> options = std::make_shared<wind_options>()) {
    ise::component_type type("wind", "blows", "sea/wind");
    auto& set = type.parameters;
    set.add("speed", options->speed, "how hard").range(0, 40).unit("m/s").changeable();
    set.add("from", options->from, "whence").range(0, 360).changeable();
    set.add("gusts", options->gusts, "or none");
    set.add("seed", options->seed, "of the gusts");
    set.add("name", options->name, "of it").one_of({"trade", "mistral"}).changeable();
    type.makes<wind>(options);
    return type;
}

void launch(fleet& all, ise::component_type& type) {
    wind::heard.clear();
    auto options = all.listening("boat");
    options.parameters = type.live();
    all.node("boat").launch("sea/wind", type.make(), std::move(options));
}

std::string values(const ise::parameters_response& of) {
    std::string text;
    for (const auto& one : of.parameters)
        for (const auto& value : one.values) text += one.about.name + "=" + value + " ";
    return text;
}

task<ise::result<ise::parameters_response>> ask_to_change(component& self,
                                                          std::vector<ise::parameter_setting> settings) {
    auto whom = self.at(fleet::at("boat"));
    ise::change_parameters_request request;
    request.settings = std::move(settings);
    auto response = co_await whom.try_call(ise::change_parameters_service, std::move(request), 10s);
    co_return response;
}

task<std::string> read(component& self) {
    auto whom = self.at(fleet::at("boat"));
    ise::parameters_request request;
    auto response = co_await whom.call(ise::parameters_service, std::move(request));
    co_return values(response);
}

} // namespace

TEST_CASE("the parameters of a running component are read and changed, and it hears of it") {
    fleet all;
    auto type = wind_type();
    REQUIRE(type.parameters.set("seed", "7"));
    launch(all, type);
    all.run("shore", [](component& self) -> task<> {
        auto before = co_await read(self);
        CHECK(before == "speed=6 from=45 gusts=true seed=7 name=trade ");
        std::vector<ise::parameter_setting> both{{"from", "90"}, {"speed", "12.5"}};
        auto response = co_await ask_to_change(self, both);
        REQUIRE(response);
        CHECK(values(*response) == "speed=12.5 from=90 ");
        auto after = co_await read(self);
        CHECK(after == "speed=12.5 from=90 gusts=true seed=7 name=trade ");
        auto whom = self.at(fleet::at("boat"));
        question asked{"how hard?"};
        auto answer = co_await whom.call(echo, asked);
        CHECK(answer.text.starts_with("12.5"));
    });
    REQUIRE(wind::heard.size() == 1); // both at once
    CHECK(wind::heard[0].speed == 12.5);
    CHECK(wind::heard[0].from == 90);
    CHECK(all.log.has("a parameter was changed", "speed"));
}

TEST_CASE("what is not allowed is refused with what is, and nothing of it happens") {
    fleet all;
    auto type = wind_type();
    launch(all, type);
    all.run("shore", [](component& self) -> task<> {
        struct trial {
            std::vector<ise::parameter_setting> settings;
            std::string says;
        };
        std::vector<trial> trials{
            {{{"from", "90"}, {"speed", "41"}},
             "parameter 'speed' cannot be '41': it must be a number from 0 to 40 (m/s)"},
            {{{"spead", "4"}}, "there is no parameter 'spead'; did you mean 'speed'?"},
            {{{"seed", "4"}}, "parameter 'seed' cannot be changed while the component runs, only speed, from, name"},
            {{{"speed", "4"}, {"speed", "5"}}, "parameter 'speed' is given twice"},
            {{{"name", "sirocco"}}, "it must be one of trade, mistral"}};
        for (auto& each : trials) {
            auto response = co_await ask_to_change(self, each.settings);
            REQUIRE(!response);
            CHECK(response.error().code() == ise::errc::refused);
            CHECK_THAT(response.error().message(), Contains(each.says));
        }
        auto after = co_await read(self);
        CHECK(after == "speed=6 from=45 gusts=true seed=1 name=trade ");
        auto whom = self.at(fleet::at("boat"));
        ise::parameters_request request;
        request.names = {"speed", "nmae"};
        auto unknown = co_await whom.try_call(ise::parameters_service, std::move(request), 10s);
        REQUIRE(!unknown);
        CHECK_THAT(unknown.error().message(), Contains("'nmae'; did you mean 'name'?"));
    });
    CHECK(wind::heard.empty());
}

TEST_CASE("a component refuses a change, and all that was asked for with it") {
    fleet all;
    auto options = std::make_shared<wind_options>();
    auto type = wind_type(options);
    REQUIRE(type.parameters.set("speed", "8"));
    launch(all, type);
    all.run("shore", [](component& self) -> task<> {
        std::vector<ise::parameter_setting> gale{{"from", "10"}, {"speed", "35"}};
        auto response = co_await ask_to_change(self, gale);
        REQUIRE(!response);
        CHECK(response.error().code() == ise::errc::refused);
        CHECK_THAT(response.error().message(), Contains("no gales"));
        std::vector<ise::parameter_setting> south{{"from", "180"}};
        auto thrown = co_await ask_to_change(self, south);
        REQUIRE(!thrown);
        CHECK(thrown.error().code() == ise::errc::handler_failed);
        auto after = co_await read(self);
        CHECK(after == "speed=8 from=45 gusts=true seed=1 name=trade ");
    });
    CHECK(options->speed == 8);
    CHECK(options->from == 45);
}

TEST_CASE("a type whose changes nobody would hear of is refused") {
    auto type = wind_type();
    type.changed = nullptr;
    CHECK(code_of([&] { type.live(); }) == ise::errc::invalid_argument);
    std::vector<std::string> words;
    CHECK(code_of([&] { type.parameters.add("word", words, "many").changeable(); }) == ise::errc::invalid_argument);
}

TEST_CASE("what is not given comes from the environment") {
    auto options = std::make_shared<wind_options>();
    auto type = wind_type(options);
    std::map<std::string, std::string> variables{{"ISE_PARAMETER_SPEED", "3"}, {"ISE_PARAMETER_FROM", "1"}};
    auto look = [&](const std::string& name) -> std::optional<std::string> {
        auto found = variables.find(name);
        return found == variables.end() ? std::nullopt : std::optional<std::string>(found->second);
    };
    REQUIRE(type.parameters.set("from", "270"));
    REQUIRE(type.parameters.set_from(look));
    CHECK(options->speed == 3);
    CHECK(options->from == 270);
    auto other = wind_type();
    variables["ISE_PARAMETER_SPEED"] = "fast";
    auto wrong = other.parameters.set_from(look);
    REQUIRE(!wrong);
    CHECK(wrong.error().message() == "the environment variable ISE_PARAMETER_SPEED: parameter 'speed' cannot be "
                                     "'fast': it must be a number from 0 to 40 (m/s)");
}

TEST_CASE("roles are written with their priority") {
    auto role = ise::parse_role("atirma/gateway=-5");
    REQUIRE(role);
    CHECK(role->first == "atirma/gateway");
    CHECK(role->second == -5);
    for (const char* wrong : {"", "a", "a=", "=5", "a=5x", "a=99999999999"}) {
        INFO(wrong);
        CHECK(!ise::parse_role(wrong));
    }
}

TEST_CASE("the nearest names are found, and no others") {
    std::vector<std::string> known{"speed", "seed", "course", "wind-from"};
    CHECK(ise::nearest("sped", known) == std::vector<std::string>{"seed", "speed"});
    CHECK(ise::nearest("from", known) == std::vector<std::string>{"wind-from"});
    CHECK(ise::nearest("temperature", known).empty());
    CHECK(ise::nearest("", known).empty());
}

} // namespace live_test
