#include <support/catch.hpp>
#include <support/program.hpp>

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
