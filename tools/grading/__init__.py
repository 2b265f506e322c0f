"""The grader behind ``make grade``: judges that students' code cannot reach.

``notebook``   a submission read as data: which code answers which exercise, and what that code needs
``wire``       how values travel, without ever unpickling what a student's process sent
``limits``     how much a student's code may take
``walls``      the limits of a student's process: time, memory, files, network
``nursery``    makes student processes, from one that has everything imported
``student``    what runs in a student's process: the student's code, and answers to questions
``judge``      the process that asks the questions and knows the answers; it never runs a student's code
``bench``      a judge at work, seen from the grader
``report``     one CSV, one HTML page
"""
