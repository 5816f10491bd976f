#include <support/catch.hpp>
#include <support/program.hpp>

#include <QFile>
#include <QImage>
#include <QTemporaryDir>

using ise_test::run_program;

TEST_CASE("console program: with nothing there it starts, takes a picture and ends") {
    QTemporaryDir folder;
    auto file = folder.filePath("console.png").toStdString();
    // Port 1: nobody listens there.
    auto ran = run_program({"atirma_console", "--name-server", "tcp://127.0.0.1:1", "--screenshot", file, "--after",
                            "0.5", "--size", "1024x600", "--night"});
    INFO(ran.err);
    CHECK(ran.exit_code == 0);
    CHECK(QImage(QString::fromStdString(file)).size() == QSize(1024, 600));
}

TEST_CASE("console program: what it cannot do is said, with an exit code") {
    CHECK(run_program({"atirma_console", "--size", "big"}).exit_code == 2);
    CHECK(run_program({"atirma_console", "--tab", "kitchen"}).exit_code == 2);
    auto named = run_program({"atirma_console", "--name-server", "7400"});
    CHECK(named.exit_code == 2);
    CHECK_FALSE(named.err.empty());
    auto hostile = run_program({"atirma_console", "--proxies", "no \x1b[2J\x9b path"});
    CHECK(hostile.exit_code == 2);
    CHECK(hostile.err.find("no  [2J\\x9b path") != std::string::npos);
    CHECK(hostile.err.find('\x1b') == std::string::npos);
    auto nowhere = run_program(
        {"atirma_console", "--name-server", "none", "--screenshot", "/no/such/folder/x.png", "--after", "0.2"});
    CHECK(nowhere.exit_code == 1);
    CHECK(nowhere.err.find("/no/such/folder") != std::string::npos);
    CHECK(run_program({"atirma_console", "--boats", "0"}).exit_code == 2);
    CHECK(run_program({"atirma_console", "--boats", "101"}).exit_code == 2);
    auto twice = run_program({"atirma_console", "--namespace", "vela,nao,vela"});
    CHECK(twice.exit_code == 2);
    CHECK(twice.err.find("'vela' twice") != std::string::npos);
    CHECK(run_program({"atirma_console", "--help"}).exit_code == 0);
}

TEST_CASE("console program: a fence holds for all boats, or for the one that it is given for") {
    QTemporaryDir folder;
    auto fence = folder.filePath("fence.json");
    QFile file(fence);
    REQUIRE(file.open(QIODevice::WriteOnly));
    file.write(
        R"({"type": "Feature", "properties": {"fence": "keep-out"}, "geometry": {"type": "Polygon", "coordinates":
        [[[-16, 27], [-15, 27], [-15, 29], [-16, 29], [-16, 27]]]}})");
    file.close();
    auto first_boat_with = [&](const QString& option) { // a part of the chart without letters
        auto picture = folder.filePath("picture.png");
        std::vector<std::string> words{
            "atirma_console", "--name-server",       "none",   "--namespace", "vela,nao", "--after", "0.7",
            "--screenshot",   picture.toStdString(), "--size", "1280x800"};
        if (!option.isEmpty()) words.insert(words.end(), {"--fence", option.toStdString()});
        auto ran = run_program(words);
        INFO(ran.err);
        REQUIRE(ran.exit_code == 0);
        return QImage(picture).copy(120, 250, 60, 60);
    };
    auto without = first_boat_with({});
    auto within = first_boat_with(fence);
    CHECK(within != without);
    CHECK(first_boat_with("vela=" + fence) == within);
    CHECK(first_boat_with("nao=" + fence) == without);

    auto path = fence.toStdString();
    auto twice = run_program({"atirma_console", "--namespace", "vela,nao", "--fence", "vela=" + path + ",vela=" + path,
                              "--screenshot", folder.filePath("x.png").toStdString()});
    CHECK(twice.exit_code == 2);
    CHECK(twice.err.find("two files for the boat vela") != std::string::npos);
    auto unknown = run_program(
        {"atirma_console", "--fence", "boat-9=" + path, "--screenshot", folder.filePath("x.png").toStdString()});
    CHECK(unknown.exit_code == 1);
    CHECK(unknown.err.find("boat-9=" + path) != std::string::npos);
}
